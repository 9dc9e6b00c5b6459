// The capturing service from the request to the receipt, with cameras that stream and a dispatcher that
// stores.
#include "services/acquisition/acquisition.h"

#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>

#include "acquire/simulator/faults.h"
#include "services/dispatcher/dispatcher.h"
#include "tests/services/burner.h"

namespace flamefield {
namespace {

using namespace testing_support;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

class AcquisitionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    auto dispatcher = Dispatcher::open(
        bus_,
        {.data_dir = scratch_ / "data", .endpoints = {"inproc://dispatcher"}, .segment_bytes = 4 << 20});
    ASSERT_TRUE(dispatcher) << dispatcher.error().message;
    dispatcher_ = std::move(*dispatcher);
    storing_ = std::jthread([this](std::stop_token stop) { EXPECT_TRUE(dispatcher_->run(stop)); });
  }
  void open(const SimulatedArrayOptions& array, double rate_hz, AcquisitionOptions options = {}) {
    auto simulated = SimulatedArray::open(array);
    ASSERT_TRUE(simulated) << simulated.error().message;
    simulated_ = std::move(*simulated);
    options.journal = scratch_ / "capture.journal";
    capturer_ = std::make_unique<Capturer>(bus_, *simulated_, rate_hz, std::move(options));
  }
  Receipt receipt_of(const std::string& capture) {
    auto reader = LedgerReader::open(scratch_ / "data");
    EXPECT_TRUE(reader) << (reader ? "" : reader.error().message);
    auto receipt = reader->receipt(capture);
    EXPECT_TRUE(receipt) << (receipt ? "" : receipt.error().message);
    return receipt.value_or(Receipt{});
  }
  std::vector<FrameSet> stored(const std::string& capture, std::int64_t sets) {
    auto client = Client::connect(bus_, "operator", unique_name("reader"), "inproc://dispatcher");
    std::vector<FrameSet> out;
    for (std::int64_t index = 0; index < sets; ++index) {
      auto data = client->ask_for<SetData>(FetchSet{{capture, index}}, 10s);
      EXPECT_TRUE(data) << index << ": " << (data ? "" : data.error().message);
      if (data) out.push_back(std::move(data->set));
    }
    return out;
  }
  void TearDown() override {
    capturer_.reset();  // before what it captures from, and what stores
  }

  Scratch scratch_;
  Bus bus_;
  std::unique_ptr<Dispatcher> dispatcher_;
  std::jthread storing_;
  std::unique_ptr<SimulatedArray> simulated_;
  std::unique_ptr<Capturer> capturer_;
};

TEST_F(AcquisitionTest, ReceiptNamesFramesThatCameAndAreInNoSet) {
  open(tiny_array(3), 20);
  CameraFaults faults;
  ASSERT_TRUE(add_fault("repeat@4", faults));
  simulated_->set_faults(1, faults);
  faults = {};
  ASSERT_TRUE(add_fault("missed@6", faults));
  ASSERT_TRUE(add_fault("corrupt@9", faults));
  simulated_->set_faults(2, faults);
  const CaptureState state = capturer_->capture({.kind = CaptureKind::Burst, .pulses = 20});
  EXPECT_EQ(state.sets_stored, 20);
  EXPECT_EQ(state.cameras[1].counters.at("duplicate"), 1);
  const Receipt receipt = receipt_of(state.id);
  EXPECT_TRUE(receipt.balances());
  EXPECT_EQ(receipt.capture.end, CaptureEnd::Complete);
  EXPECT_EQ(receipt.capture.pulses_wanted, 20);
  ASSERT_EQ(receipt.cameras.size(), 3u);
  EXPECT_EQ(receipt.cameras[1].counters.at("duplicate"), 1);
  EXPECT_EQ(receipt.cameras[1].counters.at("frames-in"), 21);
  EXPECT_EQ(receipt.cameras[1].counters.at("delivered"), 20);
  EXPECT_EQ(receipt.cameras[2].losses.at("missed"), 1);
  EXPECT_EQ(receipt.cameras[2].losses.at("corrupt"), 1) << "such a set is stored too";
}

TEST_F(AcquisitionTest, BurstFromStandbyBeginsBeforeItWasAskedFor) {
  AcquisitionOptions options;
  options.history.pulses = 30;
  open(tiny_array(3), 50, options);
  EXPECT_THAT(capturer_->refusal_of(StartCapture{.kind = CaptureKind::Burst, .pulses = 5, .pre_pulses = 5}),
              HasSubstr("standby"));
  EXPECT_EQ(capturer_->ask(StandBy{}).phase, CapturePhase::Standby);
  ASSERT_TRUE(eventually([&] { return capturer_->now().sets_held == 30; }));
  // Twice: standby goes on behind a burst without missing a pulse.
  for (int burst = 0; burst < 2; ++burst) {
    SCOPED_TRACE(burst);
    ASSERT_TRUE(eventually([&] { return capturer_->now().sets_held >= 10; }));
    const CaptureState state =
        capturer_->capture({.kind = CaptureKind::Burst, .pulses = 12, .pre_pulses = 10});
    EXPECT_EQ(state.phase, CapturePhase::Standby);
    EXPECT_EQ(state.pre_pulses, 10);
    EXPECT_EQ(state.sets_stored, 22);
    const auto sets = stored(state.id, 22);
    ASSERT_EQ(sets.size(), 22u);
    ASSERT_FALSE(sets[0].frames.empty());
    const std::int64_t first = read_test_image(sets[0].frames[0]).value().pulse;
    for (std::int64_t i = 0; i < 22; ++i) {
      const FrameSet& set = sets[static_cast<std::size_t>(i)];
      EXPECT_EQ(set.index, i);
      EXPECT_EQ(set.pulse, i - 9) << "the pulse after the request is number 1";
      EXPECT_EQ(set.kind, CaptureKind::Burst);
      EXPECT_EQ(set.frames.size(), 3u);
      EXPECT_TRUE(shows_pulse(set, first + i));
    }
    const Receipt receipt = receipt_of(state.id);
    EXPECT_TRUE(receipt.balances());
    EXPECT_EQ(receipt.capture.pre_pulses, 10);
    EXPECT_EQ(receipt.capture.pulses, 22);
  }
  EXPECT_EQ(capturer_->ask(StopCapture{}).phase, CapturePhase::Idle);
}

TEST_F(AcquisitionTest, DarkCaptureInterruptsStandbyAndItComesBack) {
  open(tiny_array(2), 50);
  capturer_->ask(StandBy{});
  ASSERT_TRUE(eventually([&] { return capturer_->now().sets_held > 2; }));
  const CaptureState dark = capturer_->capture({.kind = CaptureKind::Dark, .pulses = 5});
  EXPECT_EQ(dark.sets_stored, 5);
  EXPECT_EQ(stored(dark.id, 5).at(0).pulse, 1);
  EXPECT_TRUE(eventually([&] { return capturer_->now().phase == CapturePhase::Standby; }));
  EXPECT_TRUE(eventually([&] { return capturer_->now().sets_held > 2; }));
}

TEST_F(AcquisitionTest, BurstFromStandbyThatIsStoppedDrainsWhatWasTriggered) {
  open(tiny_array(2), 50);
  capturer_->ask(StandBy{});
  ASSERT_TRUE(eventually([&] { return capturer_->now().sets_held >= 4; }));
  capturer_->ask(StartCapture{.kind = CaptureKind::Burst, .pulses = 100'000, .pre_pulses = 4});
  ASSERT_TRUE(eventually([&] { return capturer_->now().sets > 10; }));
  const CaptureState stopped = capturer_->ask(StopCapture{});
  EXPECT_EQ(stopped.sets, stopped.sets_stored);
  const Receipt receipt = receipt_of(stopped.id);
  EXPECT_TRUE(receipt.balances());
  EXPECT_EQ(receipt.capture.end, CaptureEnd::Stopped);
  EXPECT_EQ(receipt.sets, stopped.sets);
}

TEST_F(AcquisitionTest, PicturesThatAreOnlyShownLeaveNothingBehind) {
  open(tiny_array(2), 20);
  auto client = Client::connect(bus_, "operator", unique_name("test"), "inproc://acquisition").value();
  const StartCapture shown{
      .kind = CaptureKind::Board, .pulses = 0, .id = "look", .pre_pulses = 0, .store = false};
  StartCapture counted = shown;
  counted.pulses = 3;
  EXPECT_FALSE(client.ask(counted, 10s)) << "they are shown until stopped";
  const auto began = client.ask_for<CaptureState>(shown, 30s);
  ASSERT_TRUE(began) << began.error().message;
  EXPECT_EQ(began->phase, CapturePhase::Armed);
  EXPECT_FALSE(client.ask(shown, 10s)) << "the array is in use";
  EXPECT_TRUE(eventually([&] {
    const auto newest = client.ask_for<SetData>(GetPreview{""}, 10s);
    return newest && newest->set.pulse >= 5 && newest->set.frames.size() == 2;
  }));
  const auto ended = client.ask_for<CaptureState>(StopCapture{}, 30s);
  ASSERT_TRUE(ended) << ended.error().message;
  EXPECT_EQ(ended->phase, CapturePhase::Idle);
  EXPECT_EQ(ended->sets, 0);
  EXPECT_TRUE(LedgerReader::open(scratch_ / "data")->captures()->empty());
  // And the next burst is like any other.
  const CaptureState burst = capturer_->capture({.kind = CaptureKind::Burst, .pulses = 4});
  EXPECT_EQ(burst.sets_stored, 4);
  EXPECT_TRUE(receipt_of(burst.id).balances());
}

TEST_F(AcquisitionTest, CaptureThatAnEarlierProgramLeftOpenIsClosedWithWhatItHadSeen) {
  {
    auto journal = CaptureJournal::open(scratch_ / "capture.journal");
    ASSERT_TRUE(journal) << journal.error().message;
    PutCapture left{"left", CaptureKind::Burst, 1, 0, 9, {"cam00", "cam01", "cam02"}, 30};
    journal->note(left);
  }
  auto client = Client::connect(bus_, "operator", unique_name("producer"), "inproc://dispatcher");
  for (int i = 0; i < 7; ++i) ASSERT_TRUE(client->ask_for<SetStored>(PutSet{make_set("left", i)}, 5s));
  open(tiny_array(2), 50);
  ASSERT_TRUE(eventually([&] { return receipt_of("left").capture.finished_time_ns != 0; }));
  const Receipt receipt = receipt_of("left");
  EXPECT_EQ(receipt.capture.end, CaptureEnd::Interrupted);
  EXPECT_THAT(receipt.capture.end_reason, HasSubstr("9 pulses were seen"));
  EXPECT_EQ(receipt.sets, 7);
  EXPECT_EQ(receipt.sets_not_stored, 2);
  EXPECT_TRUE(receipt.balances());
  for (const auto& line : receipt.cameras) EXPECT_EQ(line.losses.at("not-stored"), 2) << line.camera;
  // And only once.
  EXPECT_EQ(capturer_->capture({.kind = CaptureKind::Burst, .pulses = 3}).sets_stored, 3);
  EXPECT_FALSE(CaptureJournal::open(scratch_ / "capture.journal")->left_behind());
}

TEST_F(AcquisitionTest, CamerasFiredByActionCommandsGiveCompleteSetsOfTheirPulses) {
  AcquisitionOptions options;
  options.settings.trigger_source = "Action1";
  options.settings.action = ActionKeys{7, 8, 4};
  options.action_rate_hz = 20.0 / kSlowdown;
  open(tiny_array(3), 0, options);
  const CaptureState state = capturer_->capture({.kind = CaptureKind::Burst, .pulses = 15});
  const auto sets = stored(state.id, 15);
  ASSERT_EQ(sets.size(), 15u);
  for (const FrameSet& set : sets) {
    EXPECT_EQ(set.frames.size(), 3u);
    EXPECT_TRUE(shows_pulse(set, set.pulse));
  }
  EXPECT_EQ(simulated_->counters(0).edges, 0) << "no line was pulled";
}

TEST_F(AcquisitionTest, CamerasWithACommonClockFireAtOneMoment) {
  AcquisitionOptions options;
  options.settings.trigger_source = "Action1";
  options.settings.action = ActionKeys{};
  options.action_rate_hz = 20.0 / kSlowdown;
  SimulatedArrayOptions array = tiny_array(3);
  array.has_ptp = true;
  open(array, 0, options);
  const CaptureState state = capturer_->capture({.kind = CaptureKind::Burst, .pulses = 10});
  const auto sets = stored(state.id, 10);
  ASSERT_EQ(sets.size(), 10u);
  int at_one_tick = 0;  // by their own clocks; a busy machine may announce an action too late
  for (const FrameSet& set : sets) {
    ASSERT_EQ(set.frames.size(), 3u);
    at_one_tick += std::all_of(set.frames.begin(), set.frames.end(), [&](const Frame& frame) {
      return frame.device_time_ns == set.frames[0].device_time_ns;
    });
  }
  EXPECT_GE(at_one_tick, 7);
}

TEST_F(AcquisitionTest, PlanIsMadeOfWhatTheCamerasSay) {
  AcquisitionOptions options;
  options.settings.region = SensorRegion{8, 4, 40, 24};
  options.network = BandwidthNeeds{.rate_hz = 100, .uplink_bits_per_s = 4e6, .camera_link_bits_per_s = 4e6};
  // 3 x (40 x 24 + chunks) bytes: 8.5 ms of 10 ms at 4 Mbit/s; all of the sensor would take 21 ms.
  open(tiny_array(3), 50, options);
  const CaptureState state = capturer_->capture({.kind = CaptureKind::Burst, .pulses = 4});
  for (const FrameSet& set : stored(state.id, 4)) {
    for (const Frame& frame : set.frames) {
      EXPECT_EQ(frame.width_px, 40);
      EXPECT_EQ(frame.height_px, 24);
      EXPECT_EQ(frame.bytes->size(), 40u * 24u);
    }
  }
  capturer_.reset();
  options.settings.region.reset();
  options.cameras = addresses_of(*simulated_);
  options.endpoints = {"inproc://another"};
  const auto refused = Acquisition::open(bus_, options);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::InvalidInput);
  EXPECT_THAT(refused.error().message, HasSubstr("64x48 px"));
}

// --- the parts

TEST(SetHistory, KeepsTheLastPulsesWithinItsLimits) {
  const FrameSet one = make_set("a", 0, 16);
  std::int64_t set_bytes = 0;
  for (const Frame& frame : one.frames) set_bytes += static_cast<std::int64_t>(frame.bytes->size());
  SetHistory history({.pulses = 10, .bytes = 4 * set_bytes + 1});
  for (int i = 0; i < 25; ++i) history.push(make_set("a", i, 16));
  EXPECT_EQ(history.sets(), 4);
  EXPECT_EQ(history.bytes(), 4 * set_bytes);
  const auto taken = history.take_last(3);
  ASSERT_EQ(taken.size(), 3u);
  EXPECT_EQ(taken[0].index, 22);
  EXPECT_EQ(taken[2].index, 24);
  EXPECT_EQ(history.sets(), 0);
  for (int i = 0; i < 25; ++i) history.push(make_set("a", i, 2));
  EXPECT_EQ(history.sets(), 10);
  EXPECT_EQ(history.take_last(99).size(), 10u);
}

TEST(Previews, StepBackBeforeAnythingElseSuffersAndCountIt) {
  Previews previews({.most_waiting_sets = 64});
  for (int i = 0; i < 10; ++i) previews.update(make_set("a", i), 0);
  EXPECT_EQ(previews.skipped(), 0);
  EXPECT_EQ(previews.newest("cam00")->pulse, 109);
  for (int i = 10; i < 60; ++i) previews.update(make_set("a", i), 4);
  EXPECT_EQ(previews.skipped(), 2 * 40) << "one of five is shown";
  for (int i = 60; i < 160; ++i) previews.update(make_set("a", i), 33);
  EXPECT_TRUE(previews.is_paused());
  EXPECT_EQ(previews.skipped(), 2 * 140);
  EXPECT_LE(previews.newest("cam00")->pulse, 160);
  previews.update(make_set("a", 160), 0);
  EXPECT_EQ(previews.newest("cam00")->pulse, 260);
  EXPECT_FALSE(previews.is_paused());
}

TEST(CaptureJournal, TornNoteIsNotReadAndTheOneBeforeIs) {
  const Scratch scratch;
  const auto path = scratch / "journal";
  std::string whole;
  {
    auto journal = CaptureJournal::open(path);
    ASSERT_TRUE(journal);
    EXPECT_FALSE(journal->left_behind());
    for (std::int64_t pulses = 1; pulses <= 7; ++pulses)
      journal->note({"burst", CaptureKind::Burst, 1, 0, pulses});
    std::ifstream in(path, std::ios::binary);
    whole.assign(std::istreambuf_iterator<char>(in), {});
  }
  EXPECT_EQ(CaptureJournal::open(path)->left_behind()->pulses, 7);
  const std::size_t newest = whole.size() / 2;  // odd numbers are in the second half
  for (std::size_t at = 0; at < 40; ++at) {
    std::string torn = whole;
    torn[newest + at] = static_cast<char>(torn[newest + at] ^ 0x20);
    overwrite(path, torn);
    const auto journal = CaptureJournal::open(path);
    ASSERT_TRUE(journal);
    ASSERT_TRUE(journal->left_behind()) << at;
    EXPECT_EQ(journal->left_behind()->pulses, 6) << at;
  }
  auto journal = CaptureJournal::open(path);
  journal->clear();
  EXPECT_FALSE(CaptureJournal::open(path)->left_behind());
}

}  // namespace
}  // namespace flamefield
