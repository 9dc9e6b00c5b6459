#include <gtest/gtest.h>

#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using std::chrono::seconds;

TEST_F(CameraArrayTest, FifteenCamerasAtFiveHertzGiveOnlyCompleteSets) {
  SimulatedArrayOptions options = small_array(15);
  options.width_px = 659;
  options.height_px = 494;
  open(options);
  const auto sets = capture(20, 5);
  ASSERT_EQ(sets.size(), 20u);
  expect_all_there(sets, 0);
  EXPECT_EQ(report_.complete_sets, 20);
}

TEST_F(CameraArrayTest, FifteenCamerasOfTwelveBitsLosingPacketsStillGiveOnlyCompleteSets) {
  SimulatedArrayOptions options = small_array(15);
  options.width_px = 659;
  options.height_px = 494;
  CameraSettings settings;
  settings.pixel_format = PixelFormat::Mono12;
  open(options, settings);
  for (std::size_t i = 0; i < options.cameras; ++i) simulated_->set_faults(i, {.packet_loss = 0.01});
  const auto sets = capture(10, 5);
  ASSERT_EQ(sets.size(), 10u);
  expect_all_there(sets, 0);
}

TEST_F(CameraArrayTest, CameraThatDiesIsNamedLostAndTheOthersGoOn) {
  open(small_array(3));
  simulated_->set_faults(2, {.power_cuts = {{5, 1000}}});
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

TEST_F(CameraArrayTest, RevivedCameraTakesPartInTheNextCapture) {
  open(small_array(2));
  simulated_->set_power(1, false);
  SetCollector collector;
  EXPECT_FALSE(array_->start({.capture = "test", .pulses = 3}, collector.handler()));
  simulated_->set_power(1, true);
  const auto sets = capture(3, 20);
  ASSERT_EQ(sets.size(), 3u);
  expect_all_there(sets, 0);
}

}  // namespace
}  // namespace flamefield
