#include <gtest/gtest.h>

#include <map>
#include <thread>

#include "acquire/simulator/test_image.h"
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

TEST_F(CameraArrayTest, FirstFrameOfEveryCameraArrivesOnEachOfFiftyArms) {
  SimulatedArrayOptions options = small_array(15);
  options.width_px = 659;
  options.height_px = 494;
  CameraSettings settings;
  settings.test_image = true;
  open(options, settings);
  for (int arm = 0; arm < 50; ++arm) {
    SCOPED_TRACE(arm);
    SetCollector collector;
    const auto started = array_->start({.capture = "arm", .pulses = 1}, collector.handler());
    ASSERT_TRUE(started) << started.error().message;
    simulated_->generator().fire();
    ASSERT_TRUE(array_->wait_done(testing_support::kSlowdown * seconds(5)));
    array_->stop();
    const auto sets = collector.take();
    ASSERT_EQ(sets.size(), 1u);
    EXPECT_EQ(sets[0].frames.size(), 15u);
  }
}

// Waits until `holds`; false: not within ten seconds.
template <class Condition>
bool eventually(Condition holds) {
  const auto end = std::chrono::steady_clock::now() + seconds(10);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return true;
}

TEST_F(CameraArrayTest, CameraThatLosesItsPowerComesBackWithItsSettingsInTheSameCapture) {
  CameraSettings settings;
  settings.exposure_us = 777;
  settings.test_image = true;
  settings.pixel_format = PixelFormat::Mono12;
  open(small_array(4), settings);
  simulated_->set_faults(2, {.power_cuts = {{20, 40}}});
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test", .pulses = 100}, collector.handler()));
  simulated_->generator().start(20, 100);
  ASSERT_TRUE(
      eventually([&] { return array_->progress().lost_cameras == std::vector<std::string>{"cam02"}; }));
  ASSERT_TRUE(array_->wait_done(seconds(15)));
  report_ = array_->stop();
  const auto sets = collector.take();
  expect_balanced(report_, sets);
  EXPECT_EQ(report_.cameras[2].rejoins, 1);
  EXPECT_FALSE(report_.cameras[2].is_lost);
  for (const FrameSet& set : sets) {
    for (const FrameLoss& loss : set.losses) EXPECT_EQ(loss.camera, "cam02") << "pulse " << set.pulse;
    for (const Frame& frame : set.frames) {
      EXPECT_EQ(read_test_image(frame),
                (ImageStamp{static_cast<std::size_t>(frame.camera.back() - '0'), set.pulse, false}));
      EXPECT_EQ(frame.exposure_us, 777);
      EXPECT_EQ(frame.format, PixelFormat::Mono12);
    }
  }
  EXPECT_TRUE(sets.back().losses.empty()) << "it is back at the end";
}

TEST_F(CameraArrayTest, AnotherCameraAtTheAddressOfALostOneIsNotTakenForIt) {
  SimulatedArrayOptions options = small_array(3);
  open(options);
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test"}, collector.handler()));
  simulated_->generator().start(20, 0);
  ASSERT_TRUE(eventually([&] { return array_->progress().sets > 3; }));
  simulated_.reset();  // all power off; three other cameras are plugged in
  options.first_serial = "31000000";
  auto others = SimulatedArray::open(options);
  ASSERT_TRUE(others) << others.error().message;
  const bool is_lost = eventually([&] { return array_->progress().lost_cameras.size() == 3; });
  ASSERT_TRUE(is_lost);
  EXPECT_TRUE(eventually([&] {
    const auto problems = array_->progress().problems;
    return problems[1].find("31000001") != std::string::npos &&
           problems[1].find("21000001") != std::string::npos;
  }));
  array_->stop();
}

TEST_F(CameraArrayTest, CamerasDieTogetherInTheTimeOfOne) {
  open(small_array(6));
  for (std::size_t i = 0; i < 5; ++i) simulated_->set_faults(i, {.power_cuts = {{5, 1000}}});
  SetCollector collector;
  ASSERT_TRUE(array_->start({.capture = "test"}, collector.handler()));
  simulated_->generator().start(10, 30);
  ASSERT_TRUE(simulated_->generator().wait_idle(seconds(10)));
  array_->stop();
  const auto begin = std::chrono::steady_clock::now();
  array_.reset();  // each dead camera blocks for five seconds or so
  EXPECT_LT(std::chrono::steady_clock::now() - begin, testing_support::kSlowdown * seconds(9));
}

TEST_F(CameraArrayTest, FaultOfEachKindCostsWhatItMustAndNoPictureIsInAWrongSet) {
  SimulatedArrayOptions options = small_array(6);
  options.first_frame_id = 65530;  // wraps at pulse 6
  CameraSettings settings;
  settings.test_image = true;
  settings.packet_size_bytes = 576;
  open(options, settings);
  struct Row {
    const char* fault;
    LossCause cause;
    bool costs;
  };
  const Row rows[] = {{"missed@10", LossCause::Missed, true},     {"unseen@14", LossCause::Missed, true},
                      {"extra@18", LossCause::Missed, false},     {"drop@22", LossCause::Missed, false},
                      {"leader@26", LossCause::Incomplete, true}, {"trailer@30", LossCause::Incomplete, true},
                      {"mute@34", LossCause::Missed, true},       {"reorder@38", LossCause::Missed, false},
                      {"duplicate@42", LossCause::Missed, false}, {"repeat@46", LossCause::Missed, false},
                      {"corrupt@50", LossCause::Corrupt, true}};
  std::map<std::pair<std::string, std::int64_t>, LossCause> expected;
  std::size_t camera = 0;
  std::vector<CameraFaults> faults(6);
  for (const Row& row : rows) {
    camera = (camera + 1) % 6;
    ASSERT_TRUE(add_fault(row.fault, faults[camera]));
    const std::string text = row.fault;
    if (row.costs)
      expected[{concat("cam0", camera), std::stoll(text.substr(text.find('@') + 1))}] = row.cause;
  }
  for (std::size_t i = 0; i < 6; ++i) simulated_->set_faults(i, faults[i]);
  const auto sets = capture(56, 5);
  ASSERT_EQ(sets.size(), 56u);
  for (const FrameSet& set : sets) {
    for (const Frame& frame : set.frames) {
      const auto stamp = read_test_image(frame);
      ASSERT_TRUE(stamp) << frame.camera << " pulse " << set.pulse;
      EXPECT_EQ(*stamp, (ImageStamp{static_cast<std::size_t>(frame.camera.back() - '0'), set.pulse, false}));
    }
    for (const FrameLoss& loss : set.losses) {
      const auto found = expected.find({loss.camera, set.pulse});
      ASSERT_NE(found, expected.end()) << loss.camera << " pulse " << set.pulse;
      EXPECT_EQ(name_of(loss.cause), name_of(found->second)) << loss.camera << " pulse " << set.pulse;
      expected.erase(found);
    }
  }
  EXPECT_TRUE(expected.empty()) << expected.size() << " faults cost nothing";
}

}  // namespace
}  // namespace flamefield
