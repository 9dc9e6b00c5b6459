#include <gtest/gtest.h>

#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using std::chrono::seconds;

TEST_F(CameraArrayTest, CameraThatDiesIsNamedLostAndTheOthersGoOn) {
  open(small_array(3));
  simulated_->set_faults(2, {.dies_at_pulse = 5});
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test", .pulses = 12, .set_deadline_ms = 500}, collector.handler()));
  simulated_->generator().start(20, 12);
  ASSERT_TRUE(array_->wait_done(seconds(10)));
  report_ = array_->stop();
  const auto sets = collector.take();
  expect_balanced(report_, sets);
  ASSERT_EQ(sets.size(), 12u);
  for (const FrameSet& set : sets) {
    EXPECT_EQ(set.frames.size(), set.pulse < 5 ? 3u : 2u) << "pulse " << set.pulse;
  }
  EXPECT_EQ(losses_of(report_.cameras[2], LossCause::CameraLost), 8);
  EXPECT_TRUE(report_.cameras[2].is_lost);
  EXPECT_EQ(losses_of(report_.cameras[0]), 0);
}

}  // namespace
}  // namespace flamefield
