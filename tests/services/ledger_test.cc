#include "services/ledger/ledger.h"

#include <SQLiteCpp/Database.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>

#include "services/ledger/query.h"
#include "services/ledger/reader.h"
#include "services/ledger/schema.h"
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

// A lease on the oldest waiting job.
Lease lease_first(Ledger& ledger, const std::string& worker) {
  const auto waiting = ledger.queued_jobs().value();
  return ledger.lease(waiting.at(0).id, {worker, false, kNow, 1000})->value();
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
  ASSERT_TRUE(ledger.add_job(job, 1)->has_value());
  EXPECT_FALSE(ledger.add_job(job, 1)->has_value());
  EXPECT_TRUE(ledger.add_job(job_of({{"burst", 1}}), 1)->has_value());
  const Lease lease = lease_first(ledger, "w");
  EXPECT_FALSE(ledger.add_job(job, 1)->has_value());
  ASSERT_TRUE(*ledger.fail(lease.token, {.reason = "no"}));
  EXPECT_TRUE(ledger.add_job(job, 1)->has_value());
}

TEST(Ledger, AJobNeedsAStoredRigAndStoredSets) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  EXPECT_EQ(ledger.add_job(job_of({{"burst", 5}}), 1).error().code, ErrorCode::NotFound);
  Job job = job_of({{"burst", 0}});
  job.processing.rig_id = "unknown";
  EXPECT_EQ(ledger.add_job(job, 1).error().code, ErrorCode::NotFound);
}

TEST(Ledger, ALeaseCarriesRigAndReferenceSets) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  for (int i = 0; i < 3; ++i)
    ASSERT_TRUE(ledger.add_set(make_set("dark", i, 8, CaptureKind::Dark), {2, 0, 100}, kNow));
  Job job = job_of({{"burst", 0}});
  job.processing.dark_capture = "dark";
  ASSERT_TRUE(ledger.add_job(job, 1));
  const Lease lease = lease_first(ledger, "w");
  EXPECT_EQ(lease.job.dark.size(), 3u);
  EXPECT_TRUE(lease.job.flat.empty());
  EXPECT_EQ(fingerprint(lease.rig), fingerprint(make_rig()));
  EXPECT_EQ(lease.job.attempt, 1);
}

TEST(Ledger, AnOldTokenNeverCommits) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}}), 1));
  const Lease slow = lease_first(ledger, "slow");
  ASSERT_TRUE(*ledger.fail(slow.token, {.reason = "silent", .retry_at_ns = kNow}));
  const Lease quick = lease_first(ledger, "quick");
  EXPECT_GT(quick.token, slow.token);
  EXPECT_EQ(*ledger.finish(slow.token, run_of(slow), kNow), Ledger::Commit::Stale);
  EXPECT_EQ(*ledger.finish(quick.token, run_of(quick), kNow), Ledger::Commit::Done);
  EXPECT_EQ(*ledger.finish(quick.token, run_of(quick), kNow), Ledger::Commit::AlreadyDone);
  EXPECT_EQ(*ledger.finish(slow.token, run_of(slow), kNow), Ledger::Commit::Stale);
  EXPECT_FALSE(*ledger.fail(slow.token, {.reason = "late"}));
  EXPECT_EQ(ledger.status()->runs, 1);
}

TEST(Ledger, AFailedJobWaitsWithItsBackOffAndItsReason) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}}), 1));
  const Lease lease = lease_first(ledger, "w");
  ASSERT_TRUE(*ledger.fail(lease.token, {.reason = "disk full", .retry_at_ns = kNow + 500}));
  const auto waiting = ledger.queued_job(lease.job.id);
  ASSERT_TRUE(waiting && *waiting);
  EXPECT_EQ((*waiting)->not_before_ns, kNow + 500);
  EXPECT_EQ((*waiting)->share, "burst");
  EXPECT_EQ(*ledger.reason_of(lease.job.id), "disk full");
  EXPECT_EQ(lease_first(ledger, "w").job.attempt, 2);
}

TEST(Ledger, ACrashTiesTheJobToItsWorkerAndIsCounted) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}}), 1));
  const Lease lease = lease_first(ledger, "w7");
  ASSERT_TRUE(*ledger.fail(lease.token, {.reason = "signal 11", .retry_at_ns = kNow, .crashed = true}));
  EXPECT_EQ((*ledger.queued_job(lease.job.id))->tied_to, "w7");
  EXPECT_EQ((*ledger.held(lease_first(ledger, "w7").token))->crashes, 1);
}

TEST(Ledger, AJobThatKilledItsOwnProgramThreeTimesFails) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  const std::int64_t id = ledger.add_job(job_of({{"burst", 0}}), 1)->value();
  for (int life = 0; life < 3; ++life) {
    ASSERT_TRUE(ledger.lease(id, {"thread", true, kNow, 1000})->has_value()) << life;
    EXPECT_EQ(*ledger.void_all_leases(true), 1);
  }
  EXPECT_FALSE(*ledger.queued_job(id));
  EXPECT_EQ(ledger.status()->failed, 1);
}

TEST(Ledger, ControlChangesTheJobsInItsScopeOnly) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 4);
  std::vector<std::int64_t> ids;
  for (int i = 0; i < 4; ++i) {
    Job job = job_of({{"burst", i}});
    job.submission = i < 2 ? 1 : 2;
    ids.push_back(ledger.add_job(job, 1)->value());
  }
  EXPECT_EQ(ledger.control({.action = JobAction::Pause, .jobs = {ids[0]}})->size(), 1u);
  EXPECT_EQ(ledger.control({.action = JobAction::Pause, .submission = 1})->size(), 1u)
      << "one was paused before";
  EXPECT_EQ(ledger.control({.action = JobAction::Resume, .all = true})->size(), 2u);
  EXPECT_EQ(ledger.control({.action = JobAction::Cancel, .submission = 2})->size(), 2u);
  EXPECT_EQ(ledger.status()->failed, 2);
  EXPECT_EQ(ledger.jobs({.state = JobState::Failed})->at(0).why, "cancelled");
  EXPECT_TRUE(ledger.control({.action = JobAction::Retry, .all = true})->empty()) << "cancelled means it";
  EXPECT_EQ(ledger.control({.action = JobAction::Retry, .jobs = {ids[2]}})->size(), 1u);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 3}}), 1)->has_value());
  EXPECT_TRUE(ledger.control({.action = JobAction::Retry, .jobs = {ids[3]}})->empty())
      << "asked for again since";
  EXPECT_EQ(ledger.status()->queued, 4);
}

TEST(Ledger, TotalsAgreeWithTheRows) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 3);
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(ledger.add_job(job_of({{"burst", i}}), 1));
  const Lease done = lease_first(ledger, "w");
  ASSERT_TRUE(ledger.finish(done.token, run_of(done), kNow));
  ASSERT_TRUE(ledger.fail(lease_first(ledger, "w").token, {.reason = "no"}));
  {
    auto undone = ledger.begin();
    ASSERT_TRUE(ledger.add_set(make_set("burst", 9), {1, 900, 100}, kNow));
  }
  const Status status = ledger.status().value();
  EXPECT_EQ(status.sets, 3);
  EXPECT_EQ(status.runs, 1);
  EXPECT_EQ(status.queued, 1);
  EXPECT_EQ(status.leased, 0);
  EXPECT_EQ(status.done, 1);
  EXPECT_EQ(status.failed, 1);
}

TEST(Ledger, ARestartVoidsLeasesWithoutCountingTheAttempt) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 1);
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}}), 1));
  const Lease before = lease_first(ledger, "w");
  EXPECT_EQ(*ledger.void_all_leases(true), 1);
  EXPECT_EQ(*ledger.finish(before.token, run_of(before), kNow), Ledger::Commit::Stale);
  EXPECT_EQ(lease_first(ledger, "w").job.attempt, 1);
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

TEST(Ledger, LedgerOfTheFirstVersionKeepsItsFramesAndTakesCorruptOnes) {
  Scratch scratch;
  {
    SQLite::Database old(ledger_path(scratch.path()).string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    ASSERT_TRUE(migrate(old, 1));
    old.exec(
        "INSERT INTO captures(id, kind, started_time_ns, finished_time_ns, pulses, cameras) VALUES('burst', "
        "'burst', 1, 2, 1, 'cam00 cam01')");
    old.exec("INSERT INTO sets VALUES(1, 'burst', 0, 1, 1, 1, 1, 1, 0, 100, 1, 1)");
    old.exec("INSERT INTO frames VALUES(1, 'cam00', NULL), (1, 'cam01', 'late')");
  }
  auto ledger = Ledger::open(scratch.path());
  ASSERT_TRUE(ledger) << ledger.error().message;
  FrameSet set = make_set("other", 0);
  set.losses = {{"cam02", LossCause::Corrupt}};
  const auto added = ledger->add_set(set, {1, 100, 100}, kNow);
  ASSERT_TRUE(added) << added.error().message;
  auto reader = LedgerReader::open(scratch.path());
  ASSERT_TRUE(reader) << reader.error().message;
  const Receipt receipt = reader->receipt("burst").value();
  EXPECT_TRUE(receipt.balances());
  EXPECT_EQ(receipt.cameras.at(0).frames, 1);
  EXPECT_EQ(receipt.cameras.at(1).losses.at("late"), 1);
}

TEST(Ledger, CaptureSaysHowItEndedAndWhatItsCamerasWereSetTo) {
  Scratch scratch;
  Ledger ledger = open_filled(scratch, 0);
  PutCapture capture{"burst", CaptureKind::Burst,  1,          2, 0, {"cam00", "cam01"}, 40,
                     3,       CaptureEnd::Storage, "disk full"};
  capture.accounts = {{"cam00", 9, 7, {}, {{"late", 2}}}, {"cam01", 7, 7, {}, {}}};
  capture.settings = {{"exposure_us", "350"}, {"trigger", "Line1"}};
  ASSERT_TRUE(ledger.put_capture(capture));
  auto reader = LedgerReader::open(scratch.path());
  ASSERT_TRUE(reader);
  const Receipt receipt = reader->receipt("burst").value();
  EXPECT_EQ(receipt.capture.end, CaptureEnd::Storage);
  EXPECT_EQ(receipt.capture.end_reason, "disk full");
  EXPECT_EQ(receipt.capture.pulses_wanted, 40);
  EXPECT_EQ(receipt.capture.pre_pulses, 3);
  EXPECT_EQ(receipt.capture.settings, capture.settings);
  EXPECT_EQ(receipt.cameras.at(0).counters.at("late"), 2);
  EXPECT_EQ(receipt.cameras.at(0).counters.at("frames-in"), 9);
}

TEST(Ledger, AcceptedCalibrationsAreCountedAndNoneIsOverwritten) {
  const Scratch scratch;
  Rig rig = make_rig();
  {
    Ledger ledger = open_filled(scratch, 0);
    PutCalibration accepted{.calibration = {}, .rig = rig};
    accepted.calibration.version = 17;  // the ledger counts, not the sender
    accepted.calibration.accepted_by = "me";
    ASSERT_EQ(ledger.put_calibration(accepted, kNow)->version, 1);
    rig.cameras[0].fx_px += 1;
    accepted.rig = rig;
    ASSERT_EQ(ledger.put_calibration(accepted, kNow + 1)->version, 2);
    ASSERT_EQ(ledger.put_calibration(accepted, kNow + 2)->version, 3)
        << "the same rig once more is a version, too";
  }
  auto reader = LedgerReader::open(scratch.path());
  ASSERT_TRUE(reader);
  const auto all = reader->calibrations().value();
  ASSERT_EQ(all.size(), 3u);
  EXPECT_EQ(all[0].predecessor, 0);
  EXPECT_EQ(all[2].predecessor, 2);
  EXPECT_EQ(all[1].accepted_time_ns, kNow + 1);
  EXPECT_EQ(all[1].rig_id, fingerprint(rig));
  EXPECT_NE(all[0].rig_id, all[1].rig_id);
  EXPECT_EQ(reader->calibration(2)->rig.cameras[0].fx_px, rig.cameras[0].fx_px);
  EXPECT_EQ(reader->calibration(4).error().code, ErrorCode::NotFound);
  const auto counts = LedgerQuery::open(scratch.path())->accepted_rigs().value();
  ASSERT_EQ(counts.size(), 3u) << "each counts, as one that 'rigs accept' names";
  EXPECT_EQ(counts[0].rig_id, all[2].rig_id);
  EXPECT_EQ(counts[0].since_ns, kNow + 1) << "for what was taken since the one before was accepted";
  EXPECT_EQ(counts[2].since_ns, 0);
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
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}}), 1));
  const Lease lease = lease_first(ledger, "w");
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
  for (int i : {0, 1, 2, 3}) ASSERT_TRUE(ledger.add_job(job_of({{"burst", i}}), 1));
  ASSERT_TRUE(ledger.add_job(job_of({{"burst", 0}, {"burst", 1}, {"burst", 4}}), 1));
  const Lease done = lease_first(ledger, "w");
  ASSERT_TRUE(ledger.finish(done.token, run_of(done), kNow));
  const Lease failed = lease_first(ledger, "w");
  ASSERT_TRUE(ledger.fail(failed.token, {.reason = "too dark"}));

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
