// What disks, clocks and second programs do to a dispatcher: a clear error, no loss, and on it goes.
#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <fstream>

#include "services/ledger/ledger.h"
#include "tests/power/disk.h"
#include "tests/services/dispatcher_fixture.h"

namespace flamefield {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using namespace testing_support;
using Kind = DiskEvent::Kind;

class DiskFaults : public DispatcherTest {
 protected:
  ~DiskFaults() override {
    set_disk_fault(nullptr);
    set_clock_offset_ns(0);
  }
  Error refusal(const Message& question) {
    const auto answer = client_->ask(question, 5s);
    EXPECT_FALSE(answer);
    return answer ? Error{} : answer.error();
  }
  void expect_sets(int count) {
    for (int i = 0; i < count; ++i)
      EXPECT_TRUE(same_pixels(ask<SetData>(FetchSet{{"burst", i}}).set, make_set("burst", i))) << i;
    EXPECT_EQ(ask<Status>(GetStatus{}).sets, count);
  }
};

TEST_F(DiskFaults, AFullDiskUnderTheSpoolRefusesSetsUntilThereIsRoomAndLosesNone) {
  put_sets(3);
  set_disk_fault([](Kind kind, const std::string& path) {
    return (kind == Kind::Write || kind == Kind::Allocate) && path.ends_with(".raw") ? ENOSPC : 0;
  });
  const Error error = refusal(PutSet{make_set("burst", 3)});
  EXPECT_EQ(error.code, ErrorCode::Unavailable);
  EXPECT_NE(error.message.find("No space left"), std::string::npos) << error.message;
  EXPECT_NE(error.message.find("free disk space"), std::string::npos) << error.message;
  set_disk_fault(nullptr);
  ask<SetStored>(PutSet{make_set("burst", 3)});
  expect_sets(4);
}

TEST_F(DiskFaults, AFullDiskUnderTheLedgerRefusesSetsUntilThereIsRoomAndLosesNone) {
  put_sets(3);
  submit();
  set_disk_fault([](Kind kind, const std::string& path) {
    return kind == Kind::Write && path.find("ledger.sqlite") != path.npos ? ENOSPC : 0;
  });
  const Error error = refusal(PutSet{make_set("burst", 3)});
  EXPECT_EQ(error.code, ErrorCode::Unavailable) << error.message;
  EXPECT_NE(error.message.find("ledger"), std::string::npos) << error.message;
  set_disk_fault(nullptr);
  EXPECT_FALSE(ask<SetStored>(PutSet{make_set("burst", 3)}).already_there);
  expect_sets(4);
  const auto worker = start_worker(good_step());
  EXPECT_TRUE(all_done(3)) << "jobs of before the fault are done after it";
}

TEST_F(DiskFaults, AfterAFailedSyncTheSpoolIsClosedUntilARestartAndAcknowledgedSetsStay) {
  put_sets(2);
  set_disk_fault([](Kind kind, const std::string& path) {
    return kind == Kind::Sync && path.ends_with(".raw") ? EIO : 0;
  });
  EXPECT_EQ(refusal(PutSet{make_set("burst", 2)}).code, ErrorCode::Unavailable);
  set_disk_fault(nullptr);
  EXPECT_NE(refusal(PutSet{make_set("burst", 2)}).message.find("restart"), std::string::npos);
  stop();
  start();
  client_->ask(PutSet{make_set("burst", 2)}, 5s);
  expect_sets(3);
}

TEST_F(DiskFaults, AReadOnlyDirectoryIsNamedAtTheStart) {
  stop();
  set_disk_fault([](Kind kind, const std::string& path) {
    return kind == Kind::Create && path.find("flamefield-test") != path.npos ? EROFS : 0;
  });
  const auto refused = Dispatcher::open(bus_, options_);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Unavailable);
  EXPECT_NE(refused.error().message.find(scratch_.path().string()), std::string::npos)
      << refused.error().message;
  EXPECT_NE(refused.error().message.find("Read-only file system"), std::string::npos)
      << refused.error().message;
  set_disk_fault(nullptr);
  start();
}

TEST_F(DiskFaults, ADamagedPageOfTheLedgerIsSaidAndABackupAndTheSpoolBringEverySetBack) {
  put_sets(2);
  stop();
  const fs::path file = ledger_path(scratch_.path());
  fs::copy_file(file, scratch_ / "backup");
  start();
  for (int i = 2; i < 5; ++i) ask<SetStored>(PutSet{make_set("burst", i)});
  stop();
  {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    const auto size = fs::file_size(file);
    for (std::uint64_t at = 4096; at + 4096 <= size; at += 4096) {
      bytes.seekp(static_cast<std::streamoff>(at));
      bytes << std::string(256, '\xee');
    }
  }
  const auto damaged = Dispatcher::open(bus_, options_);
  ASSERT_FALSE(damaged);
  EXPECT_EQ(damaged.error().code, ErrorCode::DataLoss) << damaged.error().message;
  EXPECT_NE(damaged.error().message.find("backup"), std::string::npos) << damaged.error().message;
  fs::copy_file(scratch_ / "backup", file, fs::copy_options::overwrite_existing);
  start();
  expect_sets(5);
}

TEST_F(DiskFaults, AClockThatIsSetBackNeitherEndsLeasesNorProlongsBackOffs) {
  put_sets(3);
  submit();
  std::atomic<int> attempts = 0;
  const auto worker = start_worker([&](const JobContext& context) -> Result<flamefield::Run> {
    if (++attempts == 1) return unavailable("disk", "full", "wait");
    if (attempts == 2) {
      set_clock_offset_ns(-3600'000'000'000);
      const auto end = std::chrono::steady_clock::now() + 2 * options_.lease;
      eventually([&] { return context.stop.stop_requested() || std::chrono::steady_clock::now() > end; });
    }
    return small_step(scratch_.path(), context);
  });
  EXPECT_TRUE(all_done(3));
  EXPECT_EQ(ask<Status>(GetStatus{}).counters.count("leases_expired"), 0u);
  EXPECT_TRUE(reader().receipt("burst")->balances());
  stop();
  start();  // in the past of its own ledger
  put_sets(1, "later");
  EXPECT_EQ(ask<Status>(GetStatus{}).sets, 4);
}

TEST_F(DiskFaults, AClockThatIsSetBackBeforeARestartProlongsNoBackOffBeyondTheLongest) {
  put_sets(1);
  submit();
  {
    const auto worker = start_worker(
        [](const JobContext&) -> Result<flamefield::Run> { return unavailable("disk", "full", "wait"); });
    EXPECT_TRUE(eventually(
        [&] { return ask<Status>(GetStatus{}).leased == 0 && reader().jobs()->at(0).attempt > 0; }));
  }
  stop();
  set_clock_offset_ns(-24 * 3600'000'000'000);
  options_.max_attempts = 3;  // the longest is 80 ms
  start();
  const auto worker = start_worker(good_step());
  EXPECT_TRUE(all_done(1));
}

}  // namespace
}  // namespace flamefield
