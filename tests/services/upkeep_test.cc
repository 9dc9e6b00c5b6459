// The books against the files, with real sets, volumes and a dispatcher.
#include <gtest/gtest.h>

#include <fstream>
#include <optional>
#include <thread>

#include "proto/utc.h"
#include "reconstruct/solver.h"
#include "services/bus/client.h"
#include "services/dispatcher/dispatcher.h"
#include "services/ledger/books.h"
#include "services/ledger/figures.h"
#include "services/ledger/ledger.h"
#include "services/ledger/reader.h"
#include "services/log/log.h"
#include "services/reprocess/plan.h"
#include "services/serve/reprocessing.h"
#include "services/upkeep/check.h"
#include "services/upkeep/retention.h"
#include "services/worker/reconstruct_job.h"
#include "services/worker/worker.h"
#include "tests/services/small_lab.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using namespace std::chrono_literals;
using testing_support::eventually;
using testing_support::SmallLab;

// Three sets, reconstructed; everything in one process.
class UpkeepTest : public ::testing::Test {
 protected:
  void SetUp() override {
    set_log_level(LogLevel::Error);
    start();
    ask<RigStored>(PutRig{lab_.rig});
    for (int i = 0; i < 3; ++i) {
      ask<SetStored>(PutSet{lab_.set("dark", CaptureKind::Dark, i)});
      ask<SetStored>(PutSet{lab_.set("burst", CaptureKind::Burst, i)});
    }
    Submit order;
    order.captures = {"burst"};
    order.processing = lab_.processing(5);
    ask<Submitted>(order);
    wait_until_done(3);
  }
  void TearDown() override { stop(); }

  void start() {
    auto opened = Dispatcher::open(bus_, {.data_dir = path(), .segment_bytes = 1 << 20});
    ASSERT_TRUE(opened) << opened.error().message;
    dispatcher_ = std::move(*opened);
    serving_ = std::jthread([this](std::stop_token stop) { (void)dispatcher_->run(stop); });
    working_ = std::jthread([this](std::stop_token stop) {
      Worker worker(bus_, {.name = {}, .data_dir = path(), .heartbeat = 100ms},
                    make_reconstruct_step({path(), 1}));
      (void)worker.run(stop);
    });
    client_.emplace(Client::connect(bus_, "operator", unique_name("test"), "inproc://dispatcher").value());
  }
  void stop() {
    working_ = {};
    serving_ = {};
    client_.reset();
    dispatcher_.reset();
  }
  template <class Answer>
  Answer ask(const Message& question) {
    auto answer = client_->ask_for<Answer>(question, 10s);
    EXPECT_TRUE(answer) << answer.error().message;
    return answer ? *answer : Answer{};
  }
  void wait_until_done(std::int64_t runs) {
    ASSERT_TRUE(eventually([&] {
      const Status status = ask<Status>(GetStatus{});
      return status.done == runs && status.queued + status.leased == 0;
    }));
  }
  LedgerCheck check() {
    const auto result = check_ledger(path(), {}, [](std::int64_t, std::int64_t) {}, {});
    EXPECT_TRUE(result) << result.error().message;
    return result ? *result : LedgerCheck{};
  }
  std::vector<RunRow> runs() { return LedgerReader::open(path())->runs().value(); }
  const std::filesystem::path& path() const { return scratch_.path(); }

  // Changes one byte in the middle of a file.
  static void damage(const std::filesystem::path& file, std::int64_t at) {
    std::fstream bytes(file, std::ios::in | std::ios::out | std::ios::binary);
    bytes.seekg(at);
    const char c = static_cast<char>(bytes.get() ^ 0x55);
    bytes.seekp(at);
    bytes.put(c);
  }

  Scratch scratch_;
  SmallLab lab_;
  Bus bus_;
  std::unique_ptr<Dispatcher> dispatcher_;
  std::optional<Client> client_;
  std::jthread serving_, working_;
};

TEST_F(UpkeepTest, ARunRecordsWhereWithWhatAndWhichFilesItMade) {
  for (const RunRow& row : runs()) {
    EXPECT_FALSE(row.run.host.empty());
    EXPECT_EQ(row.run.threads, 1);
    EXPECT_GT(row.run.peak_rss_mib, 1);
    EXPECT_EQ(row.run.volume_sha256.size(), 64u);
    EXPECT_EQ(row.run.projections_sha256.size(), 64u);
    EXPECT_GT(row.run.projections_bytes, 0);
    EXPECT_EQ(row.run.processing.dark_capture, "dark");
    FILE* pipe = ::popen(("sha256sum " + (path() / row.run.volume_path).string()).c_str(), "r");
    char sum[65] = {};
    ASSERT_EQ(std::fread(sum, 1, 64, pipe), 64u);
    ::pclose(pipe);
    EXPECT_EQ(row.run.volume_sha256, sum);
  }
}

TEST_F(UpkeepTest, SoundBooksAreFoundSoundWhileTheServiceRuns) {
  const LedgerCheck found = check();
  EXPECT_TRUE(found.is_sound());
  EXPECT_TRUE(found.faults.empty());
  EXPECT_EQ(found.sets, 6);
  EXPECT_EQ(found.artefacts, 6) << "a volume and the prepared images of each run";
}

TEST_F(UpkeepTest, EveryKindOfDamageIsFound) {
  stop();
  const auto all = runs();
  damage(path() / all[0].run.volume_path, 1000);
  std::filesystem::remove(path() / all[1].run.volume_path);
  std::ofstream(path() / "volumes" / "stray.vtkhdf") << "x";
  const auto set = Books::open(path())->sets()->at(2);
  damage(path() / "spool" / "segment-000001.raw", static_cast<std::int64_t>(set.location.offset + 200));
  const LedgerCheck found = check();
  EXPECT_FALSE(found.is_sound());
  std::map<std::string, std::string> by_kind;
  for (const LedgerFault& fault : found.faults) by_kind[fault.kind] = fault.subject;
  ASSERT_EQ(found.faults.size(), 4u);
  EXPECT_EQ(by_kind["artefact-changed"], all[0].run.volume_path);
  EXPECT_EQ(by_kind["artefact-missing"], all[1].run.volume_path);
  EXPECT_EQ(by_kind["stray-file"], "volumes/stray.vtkhdf");
  EXPECT_EQ(by_kind["set"], concat(set.id.capture, " #", set.id.index));
}

TEST_F(UpkeepTest, ADamagedPageIsFoundBeforeAnythingElseIsBelieved) {
  stop();
  const auto file = ledger_path(path());
  const auto pages = static_cast<std::int64_t>(std::filesystem::file_size(file)) / 4096;
  ASSERT_GT(pages, 10);
  for (std::int64_t page = 3; page < pages; page += 4) {
    for (int i = 0; i < 100; ++i) damage(file, page * 4096 + i);
  }
  const auto found = check_ledger(path(), {}, [](std::int64_t, std::int64_t) {}, {});
  if (found) {
    EXPECT_FALSE(found->is_sound());
    for (const LedgerFault& fault : found->faults) EXPECT_NE(fault.kind, "stray-file");
  } else {
    EXPECT_EQ(found.error().code, ErrorCode::DataLoss) << found.error().message;
  }
}

TEST_F(UpkeepTest, ABackupTakenWhileTheServiceWritesIsAWholeLedger) {
  Scratch elsewhere;
  const auto copy = ledger_path(elsewhere.path());
  std::jthread writer([&](std::stop_token stop) {
    auto client = Client::connect(bus_, "operator", "writer", "inproc://dispatcher");
    for (int i = 0; !stop.stop_requested(); ++i)
      (void)client->ask(PutTags{"burst", {concat("tag-", i)}, {}}, 5s);
  });
  auto books = Books::open(path());
  ASSERT_TRUE(books);
  const auto ok = books->backup(copy, [](std::int64_t, std::int64_t) {});
  ASSERT_TRUE(ok) << ok.error().message;
  EXPECT_FALSE(books->backup(copy, [](std::int64_t, std::int64_t) {})) << "never over another file";
  writer.request_stop();
  EXPECT_TRUE(Books::open(elsewhere.path())->integrity()->empty());
  EXPECT_EQ(LedgerReader::open(elsewhere.path())->runs()->size(), 3u);
  EXPECT_FALSE(std::filesystem::exists(copy.string() + ".part"));
}

TEST_F(UpkeepTest, RetentionTakesOnlyWhatCanBeMadeAgainAndItIsMadeAgainTheSame) {
  ask<Accepted>(PutTags{runs()[2].run.id, {"keep"}, {}});
  const auto filter = *parse_filter("capture = burst", utc_now_ns());
  const auto all = runs();
  auto plan = plan_retention(path(), filter);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_EQ(plan->run_ids.size(), 2u);
  ASSERT_EQ(plan->kept.size(), 1u);
  EXPECT_NE(plan->kept[0].why.find("keep"), std::string::npos);
  EXPECT_TRUE(std::filesystem::exists(path() / all[0].run.volume_path)) << "planning removes nothing";

  ask<Accepted>(Retire{plan->run_ids});
  EXPECT_FALSE(std::filesystem::exists(path() / all[0].run.volume_path));
  EXPECT_FALSE(std::filesystem::exists(path() / all[0].run.projections_path));
  EXPECT_TRUE(std::filesystem::exists(path() / all[2].run.volume_path));
  EXPECT_EQ(LedgerReader::open(path())->runs()->size(), 3u) << "records stay";
  EXPECT_TRUE(check().faults.empty());
  EXPECT_EQ(check().retired, 4);
  EXPECT_TRUE(plan_retention(path(), filter)->run_ids.empty());

  auto query = LedgerQuery::open(path()).value();
  ReprocessOrder again;
  again.where = "capture = burst";
  const auto redo = plan_reprocessing(query, again, validate_recipe, utc_now_ns());
  ASSERT_TRUE(redo) << redo.error().message;
  EXPECT_EQ(redo->volumes(), 2);
  ASSERT_TRUE(
      submit_plan(*redo, [&](const Submit& order) { return client_->ask_for<Submitted>(order, 10s); }));
  wait_until_done(3);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(runs()[i].run.id, all[i].run.id);
    EXPECT_EQ(runs()[i].run.volume_fingerprint, all[i].run.volume_fingerprint);
    EXPECT_TRUE(std::filesystem::exists(path() / all[i].run.volume_path));
  }
  EXPECT_TRUE(check().faults.empty());
}

TEST_F(UpkeepTest, WhatCannotBeReadBackIsNeverProposed) {
  const auto set = Books::open(path())->sets()->back();
  damage(path() / "spool" / "segment-000001.raw", static_cast<std::int64_t>(set.location.offset + 200));
  const auto plan = plan_retention(path(), *parse_filter("", 0));
  ASSERT_TRUE(plan);
  EXPECT_EQ(plan->run_ids.size(), 2u);
  ASSERT_EQ(plan->kept.size(), 1u);
  EXPECT_NE(plan->kept[0].why.find("cannot be read"), std::string::npos) << plan->kept[0].why;
}

TEST_F(UpkeepTest, ACrashBetweenLedgerAndFilesLeavesNothingBehind) {
  const std::string volume = runs()[0].run.volume_path;
  stop();
  {
    auto ledger = Ledger::open(path());
    ASSERT_TRUE(ledger->retire({{runs()[0].run.id}}, utc_now_ns()));
  }
  EXPECT_EQ(check().faults.at(0).kind, "artefact-left");
  EXPECT_TRUE(check().is_sound());
  start();
  EXPECT_FALSE(std::filesystem::exists(path() / volume));
  EXPECT_TRUE(check().faults.empty());
}

// A schedule that is due, the real scheduler and the real dispatcher.
TEST_F(UpkeepTest, AScheduleMakesVolumesWhenItIsDue) {
  Schedule schedule;
  schedule.name = "again";
  schedule.cron = "* * * * *";
  schedule.order.where = "solver = mlem";
  schedule.order.settings = {"mlem.max_iterations=7"};
  schedule.created_time_ns = utc_now_ns() - 3600'000'000'000;
  ask<Accepted>(PutSchedule{schedule});
  Scheduler scheduler = make_scheduler(bus_, "inproc://dispatcher", path());
  scheduler.look();
  wait_until_done(6);
  const auto rows = LedgerQuery::open(path())->schedules();
  ASSERT_EQ(rows->size(), 1u);
  EXPECT_EQ(rows->at(0).last_outcome, "submitted") << rows->at(0).last_text;
  EXPECT_EQ(rows->at(0).jobs_left, 0);
  EXPECT_EQ(LedgerQuery::open(path())->count_work(*parse_filter("solver = mlem", 0)).value(), 6);
  // The next minute finds nothing new to do.
  ask<Accepted>(PutSchedule{schedule});
  scheduler.look();
  EXPECT_NE(LedgerQuery::open(path())->schedules()->at(0).last_text.find("0 jobs"), std::string::npos);
  const auto figures = ledger_figures(path(), utc_now_ns());
  ASSERT_TRUE(figures) << figures.error().message;
  EXPECT_EQ(figures->schedule_outcomes.at("submitted"), 2);
  EXPECT_EQ(figures->stage_s.at("solve").size(), 6u);
  EXPECT_EQ(figures->artefacts, 12);
  EXPECT_TRUE(figures->jobs.empty()) << "nothing waits";
}

}  // namespace
}  // namespace flamefield
