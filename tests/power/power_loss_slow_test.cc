// The power goes at every fsync: whatever was acknowledged before must be there after, and the service
// starts.
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <random>

#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/dispatcher/set_sender.h"
#include "services/ledger/ledger.h"
#include "services/ledger/reader.h"
#include "services/log/log.h"
#include "services/store/file.h"
#include "services/worker/worker.h"
#include "tests/power/crash_image.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using namespace testing_support;

constexpr int kSets = 12, kSide_px = 48;
constexpr std::uint64_t kSegmentBytes = 16 << 10;  // so that several are begun

std::string volume_text(const std::string& run_id) {
  return "volume of " + run_id;
}

Result<Run> small_step(const fs::path& folder, const JobContext& context) {
  const Job& job = context.lease.job;
  Run run;
  run.id = job.run_id;
  run.job_id = job.id;
  run.inputs = job.inputs;
  run.processing = job.processing;
  run.worker = context.worker;
  run.volume_path = "volumes/" + run.id + ".vtkhdf";
  if (auto ok =
          write_text_file(folder / staged_path(run.volume_path, context.lease.token), volume_text(run.id));
      !ok)
    return tl::unexpected(ok.error());
  return run;
}

// Sets pour in and become volumes while everything that reaches the disk is recorded.
std::vector<DiskEvent> recorded_run(const fs::path& folder) {
  start_recording(folder);
  Bus bus;
  auto dispatcher = Dispatcher::open(bus, {.data_dir = folder, .segment_bytes = kSegmentBytes});
  EXPECT_TRUE(dispatcher) << dispatcher.error().message;
  {
    const std::jthread serving([&](std::stop_token stop) { (void)(*dispatcher)->run(stop); });
    auto client = Client::connect(bus, "operator", "c", "inproc://dispatcher");
    EXPECT_TRUE(client->ask(PutRig{make_rig()}, 10s));
    mark("rig");
    EXPECT_TRUE(client->ask(LivePlan{true, make_processing()}, 10s));
    mark("plan");
    for (int i = 0; i < kSets; ++i) {
      EXPECT_TRUE(client->ask(PutSet{make_set("burst", i, kSide_px)}, 10s));
      mark(concat("set ", i));
    }
    const std::jthread working([&](std::stop_token stop) {
      Worker worker(bus, {.name = "w", .data_dir = folder, .heartbeat = 100ms},
                    [&](const JobContext& context) { return small_step(folder, context); });
      (void)worker.run(stop);
    });
    std::int64_t known = 0;
    EXPECT_TRUE(eventually([&] {
      auto reader = LedgerReader::open(folder);
      if (!reader) return false;
      const auto runs = reader->runs();
      if (!runs) return false;
      // What another connection reads is committed; was it durable, too?
      for (const RunRow& row : *runs) mark("run " + row.run.id);
      known = static_cast<std::int64_t>(runs->size());
      return known == kSets;
    }));
  }
  dispatcher->reset();
  return stop_recording();
}

// The acknowledged is there, and whole; and the service starts.
void check(const fs::path& folder, const std::set<std::string>& acknowledged) {
  {
    Bus bus;
    const auto started = Dispatcher::open(bus, {.data_dir = folder, .segment_bytes = kSegmentBytes});
    ASSERT_TRUE(started) << started.error().message;
  }
  auto ledger = Ledger::open(folder);
  ASSERT_TRUE(ledger) << ledger.error().message;
  auto spool = Spool::open({folder / "spool", kSegmentBytes}, *ledger->last_location());
  ASSERT_TRUE(spool) << spool.error().message;
  EXPECT_TRUE(!acknowledged.contains("rig") || ledger->rig(fingerprint(make_rig())));
  EXPECT_TRUE(!acknowledged.contains("plan") || ledger->live_plan()->on);
  for (int i = 0; i < kSets; ++i) {
    if (!acknowledged.contains(concat("set ", i))) continue;
    const auto location = ledger->location_of({"burst", i});
    ASSERT_TRUE(location) << "set " << i << ": " << location.error().message;
    const auto set = spool->read(*location);
    ASSERT_TRUE(set) << "set " << i << ": " << set.error().message;
    EXPECT_TRUE(same_pixels(*set, make_set("burst", i, kSide_px))) << "set " << i;
  }
  auto reader = LedgerReader::open(folder);
  ASSERT_TRUE(reader);
  const auto runs = reader->runs().value();
  for (const RunRow& row : runs) {
    const auto text = read_text_file(folder / row.run.volume_path, 1000);
    EXPECT_EQ(text.value_or("(missing)"), volume_text(row.run.id)) << "the ledger says that it is done";
  }
  for (const std::string& mark : acknowledged) {
    EXPECT_TRUE(!mark.starts_with("run ") || reader->run(mark.substr(4))) << mark;
  }
}

// Images are many and small; memory does.
fs::path quick_folder() {
  return fs::is_directory("/dev/shm") ? "/dev/shm" : fs::temp_directory_path();
}

TEST(PowerLoss, AtEverySyncNothingAcknowledgedIsLostAndTheServiceStarts) {
  set_log_level(LogLevel::Error);
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(concat("seed ", seed));
  std::mt19937 random(seed);
  const Scratch scratch;
  fs::create_directories(scratch / "data");
  const auto events = recorded_run(scratch / "data");
  ASSERT_FALSE(::testing::Test::HasFailure());

  std::string pattern = (quick_folder() / "flamefield-power-XXXXXX").string();
  const fs::path images = ::mkdtemp(pattern.data());
  CrashImage image;
  int syncs = 0, cuts = 0;
  const auto cut = [&](CrashImage::Unsynced unsynced, const char* when) {
    SCOPED_TRACE(concat("sync ", syncs, ", ", when, ", unsynced ",
                        unsynced == CrashImage::Unsynced::Lost ? "lost" : "torn or there"));
    const fs::path folder = images / std::to_string(++cuts);
    fs::create_directories(folder);
    image.write(folder, unsynced, random);
    check(folder, image.acknowledged());
    fs::remove_all(folder);
  };
  for (const DiskEvent& event : events) {
    const bool is_sync = event.kind == DiskEvent::Kind::Sync || event.kind == DiskEvent::Kind::SyncFolder;
    if (is_sync) {
      ++syncs;
      cut(CrashImage::Unsynced::Torn, "before");
    }
    image.apply(event);
    if (is_sync) cut(CrashImage::Unsynced::Lost, "after");
    if (::testing::Test::HasFailure()) break;
  }
  if (!::testing::Test::HasFailure()) {
    ++syncs;
    for (auto unsynced :
         {CrashImage::Unsynced::Lost, CrashImage::Unsynced::There, CrashImage::Unsynced::Torn})
      cut(unsynced, "at the end");
    EXPECT_EQ(image.acknowledged().size(), 2u + 2 * kSets);
  }
  fs::remove_all(images);
  std::printf("%d events on the disk, %d syncs, %d cuts\n", static_cast<int>(events.size()), syncs, cuts);
}

}  // namespace
}  // namespace flamefield
