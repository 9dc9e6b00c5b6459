#include "services/ledger/ledger.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "services/ledger/reader.h"
#include "tests/services/support.h"

namespace flamefield {
namespace {

using testing_support::make_processing;
using testing_support::make_rig;
using testing_support::make_set;

constexpr std::int64_t kNow = 1'700'000'000'000'000'000;

Job job_of(std::vector<SetId> inputs) {
  Job job;
  job.inputs = std::move(inputs);
  job.processing = make_processing();
  job.program_version = "0.1.0";
  job.run_id = run_id_of(job);
  job.created_time_ns = kNow;
  return job;
}

flamefield::Run run_of(const Lease& lease) {
  flamefield::Run run;
  run.id = lease.job.run_id;
  run.job_id = lease.job.id;
  run.inputs = lease.job.inputs;
  run.processing = lease.job.processing;
  run.program_version = lease.job.program_version;
  run.volume_path = "volumes/" + run.id + ".vtkhdf";
  run.solver = "mlem";
  run.residual = 0.25;
  run.metrics = {{"pearson_3d", 0.9}};
  run.residual_per_view = {{"cam00", 0.2}};
  return run;
}

// A ledger with a rig and `sets` sets of one capture.
Ledger open_filled(const Scratch& scratch, int sets) {
  auto ledger = Ledger::open(scratch.path());
  EXPECT_TRUE(ledger) << ledger.error().message;
  EXPECT_TRUE(ledger->put_rig(make_rig(), kNow));
  for (int i = 0; i < sets; ++i)
    EXPECT_TRUE(
        ledger->add_set(make_set("burst", i), {1, static_cast<std::uint64_t>(i) * 100, 100}, kNow).value());
  return std::move(*ledger);
}

std::string shell(const std::string& command) {
  std::string out;
  FILE* pipe = ::popen(command.c_str(), "r");
  for (int c = 0; (c = std::fgetc(pipe)) != EOF;) out += static_cast<char>(c);
  ::pclose(pipe);
  return out;
}

TEST(Ledger, KeepsSetsRigsAndPlansWhenItIsOpenedAgain) {
  Scratch scratch;
  const LivePlan plan{true, make_processing()};
  {
    Ledger ledger = open_filled(scratch, 3);
    ASSERT_TRUE(ledger.put_live_plan(plan));
  }
  auto ledger = Ledger::open(scratch.path());
  ASSERT_TRUE(ledger) << ledger.error().message;
  EXPECT_EQ(ledger->sets_of("burst")->size(), 3u);
  EXPECT_EQ(ledger->last_location()->offset, 200u);
  EXPECT_EQ(fingerprint(*ledger->rig(fingerprint(make_rig()))), fingerprint(make_rig()));
  EXPECT_EQ(encode(*ledger->live_plan()), encode(plan));
}

TEST(Ledger, ASetIsEnteredOnce) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  const auto again = ledger.add_set(make_set("burst", 0), {7, 7, 7}, kNow);
  ASSERT_TRUE(again);
  EXPECT_FALSE(*again);
  EXPECT_EQ(ledger.location_of({"burst", 0})->segment, 1u);
}

TEST(Ledger, WhatIsNotCommittedNeverHappened) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  {
    auto outer = ledger.begin();
    ASSERT_TRUE(ledger.add_set(make_set("burst", 1), {1, 100, 100}, kNow));
    {
      auto inner = ledger.begin_within();
      ASSERT_TRUE(ledger.add_set(make_set("burst", 2), {1, 200, 100}, kNow));
    }
    EXPECT_EQ(ledger.sets_of("burst")->size(), 2u) << "the inner one was rolled back alone";
  }
  EXPECT_EQ(ledger.sets_of("burst")->size(), 1u);
}

TEST(Ledger, IdenticalWorkIsAcceptedOnceUntilItFailed) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 2);
  const Job job = job_of({{"burst", 0}});
  ASSERT_TRUE(ledger.add_job(job)->has_value());
  EXPECT_FALSE(ledger.add_job(job)->has_value());
  EXPECT_TRUE(ledger.add_job(job_of({{"burst", 1}}))->has_value());
  const Lease lease = ledger.lease_next("w", kNow, 1000)->value();
  EXPECT_FALSE(ledger.add_job(job)->has_value());
  ASSERT_TRUE(*ledger.fail(lease.token, "no", std::nullopt));
  EXPECT_TRUE(ledger.add_job(job)->has_value());
}

TEST(Ledger, AJobNeedsAStoredRigAndStoredSets) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  EXPECT_EQ(ledger.add_job(job_of({{"burst", 5}})).error().code, ErrorCode::NotFound);
  Job job = job_of({{"burst", 0}});
  job.processing.rig_id = "unknown";
  EXPECT_EQ(ledger.add_job(job).error().code, ErrorCode::NotFound);
}

TEST(Ledger, LiveWorkGoesFirst) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 2);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}})));
  Job live = job_of({{"burst", 1}});
  live.priority = Priority::Live;
  ASSERT_TRUE(ledger.add_job(live));
  EXPECT_EQ(ledger.lease_next("w", kNow, 1000)->value().job.inputs[0].index, 1);
}

TEST(Ledger, ALeaseCarriesRigAndReferenceSets) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(ledger.add_set(make_set("dark", i, 8, CaptureKind::Dark), {2, 0, 100}, kNow));
  Job job = job_of({{"burst", 0}});
  job.processing.dark_capture = "dark";
  ASSERT_TRUE(ledger.add_job(job));
  const Lease lease = ledger.lease_next("w", kNow, 1000)->value();
  EXPECT_EQ(lease.job.dark.size(), 3u);
  EXPECT_TRUE(lease.job.flat.empty());
  EXPECT_EQ(fingerprint(lease.rig), fingerprint(make_rig()));
  EXPECT_EQ(lease.job.attempt, 1);
}

TEST(Ledger, AnOldTokenNeverCommits) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}})));
  const Lease slow = ledger.lease_next("slow", kNow, 1000)->value();
  ASSERT_TRUE(*ledger.fail(slow.token, "silent", kNow));
  const Lease quick = ledger.lease_next("quick", kNow, 1000)->value();
  EXPECT_GT(quick.token, slow.token);
  EXPECT_EQ(*ledger.finish(slow.token, run_of(slow), kNow), Ledger::Commit::Stale);
  EXPECT_EQ(*ledger.finish(quick.token, run_of(quick), kNow), Ledger::Commit::Done);
  EXPECT_EQ(*ledger.finish(quick.token, run_of(quick), kNow), Ledger::Commit::AlreadyDone);
  EXPECT_EQ(*ledger.finish(slow.token, run_of(slow), kNow), Ledger::Commit::Stale);
  EXPECT_FALSE(*ledger.fail(slow.token, "late", std::nullopt));
  EXPECT_EQ(ledger.status(kNow)->runs, 1);
}

TEST(Ledger, AFailedJobWaitsForItsBackOff) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}})));
  const Lease lease = ledger.lease_next("w", kNow, 1000)->value();
  ASSERT_TRUE(*ledger.fail(lease.token, "disk full", kNow + 500));
  EXPECT_FALSE(ledger.lease_next("w", kNow + 499, 1000)->has_value());
  EXPECT_EQ(ledger.lease_next("w", kNow + 500, 1000)->value().job.attempt, 2);
}

TEST(Ledger, ARestartVoidsLeasesWithoutCountingTheAttempt) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}})));
  const Lease before = ledger.lease_next("w", kNow, 1000)->value();
  EXPECT_EQ(*ledger.void_all_leases(), 1);
  EXPECT_EQ(*ledger.finish(before.token, run_of(before), kNow), Ledger::Commit::Stale);
  EXPECT_EQ(ledger.lease_next("w", kNow, 1000)->value().job.attempt, 1);
}

TEST(Ledger, AnotherProcessIsTurnedAwayWithThePidOfTheHolder) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 0);
  const auto refused = Ledger::open(scratch.path());
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::Unavailable);
  EXPECT_NE(refused.error().message.find(concat("process ", ::getpid())), std::string::npos)
      << refused.error().message;
}

TEST(Ledger, ALedgerOfANewerProgramIsLeftAlone) {
  Scratch scratch;
  { Ledger ledger = open_filled(scratch, 0); }
  const std::string file = ledger_path(scratch.path()).string();
  ASSERT_EQ(std::system(("sqlite3 " + file + " 'PRAGMA user_version = 999'").c_str()), 0);
  EXPECT_EQ(Ledger::open(scratch.path()).error().code, ErrorCode::InvalidInput);
  EXPECT_EQ(LedgerReader::open(scratch.path()).error().code, ErrorCode::InvalidInput);
}

TEST(Ledger, AFileThatIsNoLedgerIsRefused) {
  Scratch scratch;
  ASSERT_EQ(std::system(("head -c 8192 /dev/urandom > " + ledger_path(scratch.path()).string()).c_str()), 0);
  EXPECT_EQ(Ledger::open(scratch.path()).error().code, ErrorCode::DataLoss);
}

TEST(Ledger, IsAnOrdinarySqliteFileInWalMode) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 2);
  const std::string file = ledger_path(scratch.path()).string();
  EXPECT_EQ(shell("sqlite3 " + file + " 'SELECT count(*) FROM sets; PRAGMA journal_mode'"), "2\nwal\n");
  EXPECT_EQ(shell("sqlite3 " + file + " 'PRAGMA integrity_check; PRAGMA foreign_key_check'"), "ok\n");
  EXPECT_EQ(shell("sqlite3 " + file +
                  " 'SELECT count(*) FROM pragma_table_list WHERE schema=\"main\" AND strict=0 "
                  "AND name NOT LIKE \"sqlite_%\"'"),
            "0\n");
}

TEST(LedgerReader, SaysNotFoundBeforeThereIsALedger) {
  Scratch scratch;
  EXPECT_EQ(LedgerReader::open(scratch.path()).error().code, ErrorCode::NotFound);
}

TEST(LedgerReader, GivesRunsBackExactlyWithMetricsAddedLater) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}})));
  const Lease lease = ledger.lease_next("w", kNow, 1000)->value();
  ASSERT_TRUE(ledger.finish(lease.token, run_of(lease), kNow));
  ASSERT_TRUE(ledger.put_metrics({lease.job.run_id, {{"sqmd_3d", 0.5}}}));
  EXPECT_EQ(ledger.put_metrics({"nothing", {}}).error().code, ErrorCode::NotFound);

  auto reader = LedgerReader::open(scratch.path());
  ASSERT_TRUE(reader) << reader.error().message;
  const auto row = reader->run(lease.job.run_id);
  ASSERT_TRUE(row) << row.error().message;
  auto expected = run_of(lease);
  expected.metrics["sqmd_3d"] = 0.5;
  EXPECT_EQ(encode(Finish{1, row->run}), encode(Finish{1, expected}));
  EXPECT_EQ(reader->runs({.capture = "burst", .rig_id = "", .solver = "", .inputs = 1})->size(), 1u);
  EXPECT_TRUE(reader->runs({.capture = "other", .rig_id = "", .solver = "", .inputs = {}})->empty());
  EXPECT_EQ(reader->run("none").error().code, ErrorCode::NotFound);
}

TEST(LedgerReader, TheReceiptAccountsForEveryPulseAndEverySet) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 5);
  ASSERT_TRUE(
      ledger.put_capture({"burst", CaptureKind::Burst, kNow, kNow + 1, 5, {"cam00", "cam01", "cam02"}}));
  for (int i : {0, 1, 2, 3}) ASSERT_TRUE(ledger.add_job(job_of({{"burst", i}})));
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}, {"burst", 1}, {"burst", 4}})));
  const Lease done = ledger.lease_next("w", kNow, 1000)->value();
  ASSERT_TRUE(ledger.finish(done.token, run_of(done), kNow));
  const Lease failed = ledger.lease_next("w", kNow, 1000)->value();
  ASSERT_TRUE(ledger.fail(failed.token, "too dark", std::nullopt));

  const auto receipt = LedgerReader::open(scratch.path())->receipt("burst");
  ASSERT_TRUE(receipt) << receipt.error().message;
  EXPECT_TRUE(receipt->balances());
  EXPECT_EQ(receipt->sets, 5);
  EXPECT_EQ(receipt->volumes, 1);
  EXPECT_EQ(receipt->failed, 1);
  EXPECT_EQ(receipt->pending, 2);
  EXPECT_EQ(receipt->not_asked, 1);
  ASSERT_EQ(receipt->failures.size(), 1u);
  EXPECT_EQ(receipt->failures[0].reason, "too dark");
  ASSERT_EQ(receipt->cameras.size(), 3u);
  EXPECT_EQ(receipt->cameras[0].frames, 5);
  EXPECT_EQ(receipt->cameras[2].losses.at("incomplete"), 5);

  // A pulse that no set tells of does not balance.
  ASSERT_TRUE(
      ledger.put_capture({"burst", CaptureKind::Burst, kNow, kNow + 1, 6, {"cam00", "cam01", "cam02"}}));
  EXPECT_FALSE(LedgerReader::open(scratch.path())->receipt("burst")->balances());
}

}  // namespace
}  // namespace flamefield
