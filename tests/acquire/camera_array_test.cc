#include "acquire/camera_array.h"

#include <gmock/gmock.h>

#include <algorithm>

#include "tests/acquire/array_fixture.h"

namespace flamefield {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

TEST_F(CameraArrayTest, EverySetOfABurstIsCompleteAndShowsItsPulse) {
  open(small_array(5));
  const auto sets = capture(20, 50);
  ASSERT_EQ(sets.size(), 20u);
  expect_all_there(sets, 0);
  EXPECT_EQ(report_.complete_sets, 20);
}

TEST_F(CameraArrayTest, ASecondCaptureWithTheSameCamerasCountsFromOneAgain) {
  open(small_array(3));
  expect_all_there(capture(5, 50), 0);
  simulated_->generator().fire();  // between captures: belongs to none
  const auto sets = capture(5, 50);
  ASSERT_EQ(sets.size(), 5u);
  expect_all_there(sets, 6);
}

TEST_F(CameraArrayTest, MissedTriggerIsOneNamedLossAndShiftsNothing) {
  open(small_array(3));
  simulated_->set_faults(1, {.missed_pulses = {4}});
  const auto sets = capture(10, 50);
  ASSERT_EQ(sets.size(), 10u);
  for (const FrameSet& set : sets) {
    for (const Frame& frame : set.frames) {
      EXPECT_TRUE(shows(frame, static_cast<std::size_t>(frame.camera.back() - '0'), set.pulse));
    }
    if (set.pulse != 4) {
      EXPECT_TRUE(set.losses.empty());
      continue;
    }
    ASSERT_EQ(set.losses.size(), 1u);
    EXPECT_EQ(set.losses[0].camera, "cam01");
    EXPECT_EQ(set.losses[0].cause, LossCause::Missed);
  }
}

TEST_F(CameraArrayTest, LostPacketsAreAskedForAgain) {
  SimulatedArrayOptions options = small_array(3);
  options.width_px = 320;
  options.height_px = 240;
  CameraSettings settings;
  settings.packet_size_bytes = 576;  // 142 packets a frame
  open(options, settings);
  for (std::size_t i = 0; i < 3; ++i) simulated_->set_faults(i, {.packet_loss = 0.01});
  const auto sets = capture(15, 15);
  expect_all_there(sets, 0);
  std::int64_t dropped = 0;
  for (std::size_t i = 0; i < 3; ++i) dropped += simulated_->counters(i).dropped;
  EXPECT_GT(dropped, 20) << "the fault was not exercised";
}

TEST_F(CameraArrayTest, FrameWithoutItsLeaderIsNamedIncomplete) {
  open(small_array(2));
  simulated_->set_faults(0, {.lost_leaders = {3}});
  const auto sets = capture(8, 10);
  ASSERT_EQ(sets.size(), 8u);
  ASSERT_EQ(sets[2].losses.size(), 1u);
  EXPECT_EQ(sets[2].losses[0].camera, "cam00");
  EXPECT_EQ(sets[2].losses[0].cause, LossCause::Incomplete);
  EXPECT_EQ(report_.complete_sets, 7);
}

TEST_F(CameraArrayTest, StopDeliversEveryPulseThatWasTriggeredBeforeIt) {
  open(small_array(3));
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "live", .kind = CaptureKind::Live}, collector.handler()));
  for (int i = 0; i < 3; ++i) simulated_->generator().fire();
  report_ = array_->stop();  // while the last pictures are on their way
  const auto sets = collector.take();
  expect_balanced(report_, sets);
  ASSERT_EQ(sets.size(), 3u);
  expect_all_there(sets, 0);
}

TEST_F(CameraArrayTest, TriggerThatNeverStopsDoesNotShiftCamerasAgainstEachOther) {
  open(small_array(4));
  simulated_->generator().start(40, 0);
  SetCollector collector;
  const auto started = array_->start({.capture = "test", .pulses = 10}, collector.handler());
  ASSERT_TRUE(started) << started.error().message;
  ASSERT_TRUE(array_->wait_done(seconds(10)));
  report_ = array_->stop();
  const auto sets = collector.take();
  expect_balanced(report_, sets);
  ASSERT_EQ(sets.size(), 10u);
  // The first pixel of camera 0 tells the generator's number of pulse 1.
  ASSERT_EQ(sets[0].frames.size(), 4u);
  std::int64_t before = -1;
  for (std::int64_t n = 0; n < 200 && before < 0; ++n) {
    if (shows(sets[0].frames[0], 0, n + 1)) before = n;
  }
  ASSERT_GE(before, 0);
  expect_all_there(sets, before);
}

class CameraArrayFormatTest : public CameraArrayTest, public ::testing::WithParamInterface<PixelFormat> {};

TEST_P(CameraArrayFormatTest, PixelsArriveAsTheSensorGaveThem) {
  CameraSettings settings;
  settings.pixel_format = GetParam();
  open(small_array(2), settings);
  const auto sets = capture(3, 50);
  ASSERT_EQ(sets.size(), 3u);
  expect_all_there(sets, 0);
  EXPECT_EQ(sets[0].frames[0].format, GetParam());
}
INSTANTIATE_TEST_SUITE_P(All, CameraArrayFormatTest,
                         ::testing::Values(PixelFormat::Mono8, PixelFormat::Mono12, PixelFormat::Mono12Packed,
                                           PixelFormat::Mono16),
                         [](const auto& test) { return std::string(name_of(test.param)); });

TEST_F(CameraArrayTest, PulseTimeIsTheGeneratorsToWithinTwoMilliseconds) {
  open(small_array(3));
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test", .pulses = 1}, collector.handler()));
  const Pulse pulse = simulated_->generator().fire();
  ASSERT_TRUE(array_->wait_done(seconds(5)));
  array_->stop();
  const auto sets = collector.take();
  ASSERT_EQ(sets.size(), 1u);
  EXPECT_NEAR(static_cast<double>(sets[0].pulse_time_ns - pulse.time_ns), 0, 2e6);
}

TEST_F(CameraArrayTest, SoftwareTriggerTakesOnePictureOfEachCamera) {
  CameraSettings settings;
  settings.trigger_source = "Software";
  open(small_array(2), settings);
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test"}, collector.handler()));
  ASSERT_TRUE(array_->software_trigger());
  const auto end = std::chrono::steady_clock::now() + seconds(5);
  while (array_->progress().sets < 1 && std::chrono::steady_clock::now() < end)
    array_->wait_done(milliseconds(5));
  array_->stop();
  EXPECT_GE(collector.take().size(), 1u);
}

TEST_F(CameraArrayTest, CameraThatDoesNotAnswerIsNamed) {
  const auto array = CameraArray::open({{"cam07", first_test_address()}}, {});
  ASSERT_FALSE(array);
  EXPECT_EQ(array.error().code, ErrorCode::Unavailable);
  EXPECT_THAT(array.error().message, HasSubstr("cam07"));
}

TEST_F(CameraArrayTest, CameraThatAnotherProgramControlsIsRefused) {
  open(small_array(1));
  const auto second = CameraArray::open(addresses_of(*simulated_), {});
  ASSERT_FALSE(second);
  EXPECT_THAT(second.error().message, HasSubstr("another program"));
}

TEST_F(CameraArrayTest, SettingsOutOfRangeAreRefusedByName) {
  CameraSettings settings;
  settings.exposure_us = 0;
  const auto array = CameraArray::open({{"cam00", first_test_address()}}, settings);
  ASSERT_FALSE(array);
  EXPECT_EQ(array.error().code, ErrorCode::InvalidInput);
  EXPECT_THAT(array.error().message, HasSubstr("exposure_us=0"));
}

}  // namespace
}  // namespace flamefield
