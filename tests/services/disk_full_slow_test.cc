// The disk that sets go to is full in the middle of a capture. The storing program has a small file system of
// its own, made in a namespace where a user may mount one.
#include <gmock/gmock.h>

#include <cstdlib>
#include <optional>

#include "services/store/file.h"
#include "tests/services/burner.h"
#include "tests/services/chaos.h"

namespace flamefield {
namespace {

using namespace testing_support;
using namespace std::chrono_literals;
using ::testing::HasSubstr;

constexpr const char* kMountAndServe =
    "mount -t tmpfs -o size=34m tmpfs \"$1\" && head -c 16000000 /dev/zero > \"$1/ballast\" && shift && exec "
    "\"$@\"";

class FullDisk : public ::testing::Test {
 protected:
  void SetUp() override {
    if (std::system("unshare -Urm mount -t tmpfs tmpfs /mnt > /dev/null 2>&1") != 0)
      GTEST_SKIP() << "this system lets users mount nothing (unshare -Urm)";
    std::filesystem::create_directories(data());
    bus_.emplace(KeyRing::open_or_create(scratch_ / "keys").value());
    std::string endpoint;
    {
      Router probe(*bus_);  // a port that is free, and stays so for a moment
      ASSERT_TRUE(probe.bind("tcp://127.0.0.1:*"));
      endpoint = probe.bound_endpoint();
    }
    dispatcher_.emplace("/usr/bin/unshare",
                        std::vector<std::string>{"-Urm", "sh", "-c", kMountAndServe, "sh", data().string(),
                                                 concat(FLAMEFIELD_BIN, "/flamefield-dispatchd"), "--data",
                                                 data().string(), "--endpoint", endpoint, "--keys",
                                                 (scratch_ / "keys").string(), "--segment-mib", "4"},
                        scratch_ / "log");
    reader_.emplace(Client::connect(*bus_, "worker", unique_name("reader"), endpoint).value());
    ASSERT_TRUE(eventually([&] { return log().find("dispatcher-started") != std::string::npos; })) << log();
    SimulatedArrayOptions array = tiny_array(3);
    array.width_px = 320;
    array.height_px = 240;
    auto simulated = SimulatedArray::open(array);
    ASSERT_TRUE(simulated) << simulated.error().message;
    simulated_ = std::move(*simulated);
    AcquisitionOptions options;
    options.dispatcher_endpoint = endpoint;
    options.most_waiting_sets = 30;
    options.journal = scratch_ / "capture.journal";
    capturer_.emplace(*bus_, *simulated_, 20, std::move(options));
  }
  std::filesystem::path data() const { return scratch_ / "data"; }
  std::string log() const { return read_text_file(scratch_ / "log").value_or(""); }
  // The same folder as the storing program sees it.
  std::filesystem::path its_data() const {
    return concat("/proc/", dispatcher_->pid(), "/root", data().string());
  }

  void expect_intact(const std::string& capture, std::int64_t sets) {
    for (std::int64_t index = 0; index < sets; ++index) {
      const auto found = reader_->ask_for<SetData>(FetchSet{{capture, index}}, 10s);
      ASSERT_TRUE(found) << index << ": " << found.error().message;
      EXPECT_EQ(found->set.frames.size() + found->set.losses.size(), 3u) << index;
      EXPECT_TRUE(shows_pulse(found->set, found->set.pulse + pulses_before_)) << index;
    }
  }
  // The books, copied out of the other namespace.
  Receipt receipt_of(const std::string& capture) {
    for (const char* name : {"ledger.sqlite", "ledger.sqlite-wal"})
      std::filesystem::copy_file(its_data() / name, scratch_ / name,
                                 std::filesystem::copy_options::overwrite_existing);
    auto reader = LedgerReader::open(scratch_.path());
    EXPECT_TRUE(reader) << (reader ? "" : reader.error().message);
    events_ = reader->events().value();
    return reader->receipt(capture).value();
  }

  Scratch scratch_;
  std::optional<Bus> bus_;
  std::optional<Process> dispatcher_;
  std::optional<Client> reader_;
  std::unique_ptr<SimulatedArray> simulated_;
  std::optional<Capturer> capturer_;
  std::vector<Event> events_;
  std::int64_t pulses_before_ = 0;  // of the generator, before the capture
};

TEST_F(FullDisk, PreviewsGoFirstThenTheCaptureEndsLoudlyAndLosesNothing) {
  CaptureState state = capturer_->ask(StartCapture{.kind = CaptureKind::Live});
  const std::string capture = state.id;
  std::int64_t skipped_while_recording = 0;
  ASSERT_TRUE(eventually(
      [&] {
        state = capturer_->now();
        if (state.phase == CapturePhase::Armed) skipped_while_recording = state.previews_skipped;
        return state.phase == CapturePhase::Draining;
      },
      30s));
  EXPECT_GT(skipped_while_recording, 0) << "looking stepped back while recording went on";
  EXPECT_GT(state.sets_stored, 0);
  EXPECT_GT(state.sets, state.sets_stored + 30);
  EXPECT_THAT(state.trouble, HasSubstr("faster than they could be stored"));
  EXPECT_TRUE(eventually([&] { return capturer_->now().trouble.find("No space left") != std::string::npos; }))
      << capturer_->now().trouble;
  EXPECT_THAT(capturer_->refusal_of(GetPreview{"cam00"}), HasSubstr("recording goes first"));
  EXPECT_THAT(capturer_->refusal_of(StartCapture{}), HasSubstr("is running"));
  expect_intact(capture, state.sets_stored);
  std::printf("full after %ld sets; %ld waited in memory; %ld preview frames skipped by then\n",
              static_cast<long>(state.sets_stored), static_cast<long>(state.sets - state.sets_stored),
              static_cast<long>(skipped_while_recording));

  ASSERT_TRUE(std::filesystem::remove(its_data() / "ballast"));  // someone makes room
  ASSERT_TRUE(eventually([&] { return !is_capturing((state = capturer_->now()).phase); }, 30s))
      << state.trouble;
  EXPECT_EQ(state.sets, state.sets_stored);
  expect_intact(capture, state.sets);
  const Receipt receipt = receipt_of(capture);
  EXPECT_EQ(receipt.capture.end, CaptureEnd::Storage);
  EXPECT_TRUE(receipt.balances());
  EXPECT_EQ(receipt.sets, state.sets);
  EXPECT_TRUE(std::any_of(events_.begin(), events_.end(), [&](const Event& event) {
    return event.subject == capture && event.text.find("faster than") != std::string::npos;
  }));

  pulses_before_ = simulated_->generator().pulses();
  state = capturer_->capture({.kind = CaptureKind::Burst, .pulses = 10});
  EXPECT_EQ(state.sets_stored, 10);
  EXPECT_EQ(state.trouble, "");
  expect_intact(state.id, 10);
}

}  // namespace
}  // namespace flamefield
