// The program that captures is killed with -9 at random moments while cameras stream and the storing one
// lives. FLAMEFIELD_KILLS=20 is the whole of it.
#include <gtest/gtest.h>

#include <cstdlib>
#include <map>
#include <optional>
#include <random>
#include <set>

#include "services/bus/client.h"
#include "services/ledger/reader.h"
#include "services/serve/endpoints.h"
#include "services/store/file.h"
#include "tests/acquire/array_fixture.h"
#include "tests/services/chaos.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::eventually;
using testing_support::kSlowdown;
using testing_support::Process;

constexpr int kWidth_px = 320, kHeight_px = 240;
constexpr std::size_t kCameras = 3;

class KilledCapture : public ::testing::Test {
 protected:
  void SetUp() override {
    SimulatedArrayOptions options = small_array(kCameras);
    options.width_px = kWidth_px;
    options.height_px = kHeight_px;
    auto array = SimulatedArray::open(options);
    ASSERT_TRUE(array) << array.error().message;
    array_ = std::move(*array);
    array_->set_scene(coded_scene(kWidth_px, kHeight_px));
    std::string lab = "data_directory = \"data\"\n[capture]\nexposure_us = 350\n";
    for (const CameraAddress& camera : addresses_of(*array_))
      lab += concat("[[camera]]\nname = \"", camera.name, "\"\naddress = \"", camera.address, "\"\n");
    overwrite(scratch_ / "lab.toml", lab);
    dispatcher_.emplace("flamefield-dispatchd", std::vector<std::string>{"--data", data().string()},
                        scratch_ / "dispatchd.log");
    endpoints_ = endpoints_of(data()).value();
    ASSERT_TRUE(eventually([&] { return std::filesystem::exists(data() / "run/dispatcher.sock"); }));
    bus_.emplace(KeyRing::open_or_create(endpoints_.keys).value());
  }
  std::filesystem::path data() const { return scratch_ / "data"; }
  // Cameras are held by the dead program until their heartbeat runs out.
  void start_program() {
    std::filesystem::remove(scratch_ / "acquired.log");
    program_.emplace("flamefield-acquired",
                     std::vector<std::string>{"--config", (scratch_ / "lab.toml").string()},
                     scratch_ / "acquired.log");
    ASSERT_TRUE(eventually([&] { return log().find("acquisition-started") != std::string::npos; }, 20s))
        << log();
  }
  std::string log() const { return read_text_file(scratch_ / "acquired.log").value_or(""); }
  Client client_of(const std::string& endpoint, const std::string& role = "operator") {
    return Client::connect(*bus_, role, unique_name("test"), endpoint).value();
  }
  void expect_accounted_for(const std::string& capture, std::int64_t acknowledged);

  Scratch scratch_;
  std::unique_ptr<SimulatedArray> array_;
  Endpoints endpoints_;
  std::optional<Process> dispatcher_, program_;
  std::optional<Bus> bus_;
  std::int64_t sets_ = 0, not_stored_ = 0;
};

void KilledCapture::expect_accounted_for(const std::string& capture, std::int64_t acknowledged) {
  SCOPED_TRACE(capture);
  auto reader = LedgerReader::open(data());
  ASSERT_TRUE(reader) << reader.error().message;
  const auto receipt = reader->receipt(capture);
  ASSERT_TRUE(receipt) << receipt.error().message;
  EXPECT_EQ(receipt->capture.end, CaptureEnd::Interrupted);
  EXPECT_TRUE(receipt->balances());
  EXPECT_GE(receipt->sets, acknowledged) << "acknowledged sets are there";
  EXPECT_EQ(receipt->capture.pulses, receipt->sets + receipt->sets_not_stored);
  sets_ += receipt->sets;
  not_stored_ += receipt->sets_not_stored;
  const auto rows = reader->sets(capture);
  ASSERT_TRUE(rows);
  std::set<std::int64_t> indices;
  for (const SetRow& row : *rows)
    EXPECT_TRUE(indices.insert(row.id.index).second) << row.id.index << " twice";
  Client client = client_of(endpoints_.dispatcher, "worker");
  std::optional<std::int64_t> before;  // pulses of the generator before the first one of the capture
  for (std::int64_t index : indices) {
    const auto data = client.ask_for<SetData>(FetchSet{{capture, index}}, 10s);
    ASSERT_TRUE(data) << index << ": " << data.error().message;
    EXPECT_EQ(data->set.pulse, index + 1);
    for (const Frame& frame : data->set.frames) {
      const auto camera = static_cast<std::size_t>(frame.camera.back() - '0');
      for (std::int64_t n = 0; n < 4096 && !before; ++n) {
        if (shows(frame, camera, data->set.pulse + n)) before = n;
      }
      ASSERT_TRUE(before) << "no pulse looks like that";
      EXPECT_TRUE(shows(frame, camera, data->set.pulse + *before));
    }
  }
}

TEST_F(KilledCapture, EveryAcknowledgedSetIsReadableNoneIsThereTwiceAndTheRestIsNamed) {
  const char* wanted = std::getenv("FLAMEFIELD_KILLS");
  const int kills = wanted ? std::atoi(wanted) : 4;
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(concat("seed ", seed));
  std::mt19937 random(seed);
  array_->generator().start(40.0 / kSlowdown, 0);
  std::map<std::string, std::int64_t> acknowledged;
  for (int kill = 0; kill < kills; ++kill) {
    SCOPED_TRACE(kill);
    ASSERT_NO_FATAL_FAILURE(start_program());
    const std::string capture = concat("burst-", kill);
    Client client = client_of(endpoints_.acquisition);
    ASSERT_TRUE(client.tell(StartCapture{.kind = CaptureKind::Burst, .pulses = 0, .id = capture}));
    const auto kill_at =
        std::chrono::steady_clock::now() + kSlowdown * std::chrono::milliseconds(random() % 1500);
    std::int64_t& seen = acknowledged[capture];
    while (std::chrono::steady_clock::now() < kill_at) {
      const auto state = client.ask_for<CaptureState>(GetCapture{}, kSlowdown * 1s);
      if (state && state->id == capture) seen = std::max(seen, state->sets_stored);
    }
    program_.reset();  // with -9
  }
  ASSERT_NO_FATAL_FAILURE(start_program());
  Client client = client_of(endpoints_.acquisition);
  // A capture goes well again; before it starts, the last one that was left open is closed.
  const auto state =
      client.ask_for<CaptureState>(StartCapture{.kind = CaptureKind::Burst, .pulses = 5, .id = "after"}, 30s);
  ASSERT_TRUE(state) << state.error().message;
  ASSERT_TRUE(eventually([&] {
    const auto now = client.ask_for<CaptureState>(GetCapture{}, 5s);
    return now && !is_capturing(now->phase);
  }));
  for (const auto& [capture, count] : acknowledged) {
    auto reader = LedgerReader::open(data());
    ASSERT_TRUE(reader);
    if (count == 0 && !reader->receipt(capture)) continue;  // killed before it had begun
    expect_accounted_for(capture, count);
  }
  EXPECT_GT(sets_, 0);
  std::printf("%d kills, %ld sets stored, %ld seen and not stored\n", kills, static_cast<long>(sets_),
              static_cast<long>(not_stored_));
}

}  // namespace
}  // namespace flamefield
