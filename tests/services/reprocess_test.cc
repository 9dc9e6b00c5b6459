#include "services/reprocess/plan.h"

#include <gtest/gtest.h>

#include "services/reprocess/sweep.h"
#include "tests/services/ledger_fixture.h"

namespace flamefield {
namespace {

using testing_support::FilledLedger;
using testing_support::kFirstPulse_ns;
using testing_support::kNow_ns;
using testing_support::make_processing;
using testing_support::make_rig;
using testing_support::make_set;

using Ids = std::vector<std::string>;

Processing with_solver(const std::string& solver) {
  Processing processing = make_processing();
  processing.recipe.solver = solver;
  return processing;
}

Rig moved_rig() {
  Rig rig = make_rig();
  rig.cameras[0].camera_from_world.translation_mm[0] += 1;
  return rig;
}

Result<> anything(const Recipe& recipe) {
  if (recipe.settings.contains("no.such")) return invalid_input("no.such", "unknown", "drop it");
  return {};
}

ReprocessPlan plan_of(const FilledLedger& ledger, const ReprocessOrder& order) {
  auto query = ledger.query();
  auto plan = plan_reprocessing(query, order, anything, kNow_ns);
  EXPECT_TRUE(plan) << plan.error().message;
  return plan ? *plan : ReprocessPlan{};
}

TEST(LedgerQuery, EveryFieldFindsWhatItSays) {
  FilledLedger ledger(4);
  const std::string first = ledger.add_run({{"burst", 0}}, with_solver("mlem"), 0.1);
  const std::string second = ledger.add_run({{"burst", 1}}, with_solver("map"), 0.3);
  const std::string mean =
      ledger.add_run({{"burst", 2}, {"burst", 3}}, with_solver("mlem"), 0.2, kNow_ns + 1);
  ASSERT_TRUE(ledger.writer().put_tags({first, {"good"}, {}}));
  ASSERT_TRUE(ledger.writer().put_tags({"burst", {"lean"}, {}}));

  EXPECT_EQ(ledger.find("").size(), 3u);
  EXPECT_EQ(ledger.find("").front(), mean) << "the newest first";
  EXPECT_EQ(ledger.find("solver = map"), Ids{second});
  EXPECT_EQ(ledger.find("residual < 0.15"), Ids{first});
  EXPECT_EQ(ledger.find("residual >= 0.15 and not solver = map"), Ids{mean});
  EXPECT_EQ(ledger.find("inputs = 2"), Ids{mean});
  EXPECT_EQ(ledger.find("index in (1, 7)"), Ids{second});
  EXPECT_EQ(ledger.find("pulse = 101"), Ids{second});
  EXPECT_EQ(ledger.find("capture ~ 'bu*' and kind = burst").size(), 3u);
  EXPECT_EQ(ledger.find("time >= 2023-11-14T22:13:20Z and index = 0"), Ids{first});
  EXPECT_EQ(ledger.find("tag = good"), Ids{first});
  EXPECT_EQ(ledger.find("tag = lean").size(), 3u) << "a capture's tag counts for its runs";
  EXPECT_EQ(ledger.find("tag != good and solver = mlem"), Ids{mean});
  EXPECT_EQ(ledger.find("metric.pearson_3d > 0.85"), Ids{first});
  EXPECT_TRUE(ledger.find("metric.nothing > 0").empty());
  EXPECT_EQ(ledger.find("not metric.nothing > 0").size(), 3u);
  EXPECT_EQ(ledger.find(concat("run = '", second, "'")), Ids{second});
  EXPECT_EQ(ledger.find(concat("rig = ", fingerprint(make_rig()), " and losses = 1 and frames = 2")).size(),
            3u);
  EXPECT_EQ(ledger.find("finished > now"), Ids{mean});
  EXPECT_EQ(
      ledger
          .find("created <= now and worker = '' and attempts = 1 and iterations = 0 and queue_s = 0 and "
                "solve_s = 2 and reason = ''")
          .size(),
      3u);
  EXPECT_EQ(ledger.find("solver = map or (solver = mlem and inputs = 1)").size(), 2u);
  EXPECT_TRUE(ledger.find("stale").empty());
}

TEST(LedgerQuery, TheStateBringsWorkThatIsNotDone) {
  FilledLedger ledger(3);
  const std::string done = ledger.add_run({{"burst", 0}});
  const Lease lease = ledger.lease_of(ledger.writer().add_job(ledger.job({{"burst", 1}}), 0)->value());
  ASSERT_TRUE(*ledger.writer().fail(lease.token, {.reason = "too dark"}));
  ASSERT_TRUE(ledger.writer().add_job(ledger.job({{"burst", 2}}), 0)->has_value());
  EXPECT_EQ(ledger.find("capture = burst"), Ids{done});
  EXPECT_EQ(ledger.find("state = failed"), Ids{ledger.job({{"burst", 1}}).run_id});
  EXPECT_EQ(ledger.find("state != done").size(), 2u);
  EXPECT_EQ(ledger.find("state = done and index = 0 and solver = hessian"), Ids{done});
  const auto rows = ledger.query().work(*parse_filter("state = failed", 0), 10);
  EXPECT_EQ(rows->at(0).reason, "too dark");
  EXPECT_EQ(rows->at(0).run.processing.rig_id, fingerprint(make_rig()));
}

TEST(LedgerQuery, AVolumeIsStaleWhenANewerCalibrationCountsForItsPulse) {
  FilledLedger ledger(4);
  for (int i = 0; i < 4; ++i) ledger.add_run({{"burst", i}}, make_processing(), 0.1, kNow_ns + i);
  EXPECT_TRUE(ledger.find("stale").empty());
  ASSERT_TRUE(ledger.writer().put_rig(moved_rig(), kNow_ns));
  // It counts for pulses from the third set on.
  const std::int64_t since = make_set("burst", 2).pulse_time_ns;
  ASSERT_TRUE(ledger.writer().accept_rig({fingerprint(moved_rig()), since}, kNow_ns + 10));
  EXPECT_EQ(ledger.find("stale").size(), 2u);
  EXPECT_EQ(ledger.find("stale and index < 2").size(), 0u);
  Processing again = make_processing();
  again.rig_id = fingerprint(moved_rig());
  ledger.add_run({{"burst", 2}}, again, 0.1, kNow_ns + 20);
  EXPECT_EQ(ledger.find("stale").size(), 2u) << "the new volume is not, the old one still is";
  // Whoever takes the old calibration on purpose afterwards is not told off.
  Processing on_purpose = with_solver("mlem");
  ledger.add_run({{"burst", 3}}, on_purpose, 0.1, kNow_ns + 30);
  EXPECT_EQ(ledger.find("stale").size(), 2u);
  EXPECT_FALSE(ledger.writer().accept_rig({"unknown", 0}, kNow_ns));
}

TEST(Reprocess, AStaleVolumeIsOfferedOnceWithItsCalibration) {
  FilledLedger ledger(2);
  for (int i = 0; i < 2; ++i) ledger.add_run({{"burst", i}});
  ASSERT_TRUE(ledger.writer().put_rig(moved_rig(), kNow_ns));
  ASSERT_TRUE(ledger.writer().accept_rig({fingerprint(moved_rig()), 0}, kNow_ns + 10));
  ReprocessOrder order;
  order.stale = true;
  const ReprocessPlan plan = plan_of(ledger, order);
  EXPECT_EQ(plan.volumes(), 2);
  ASSERT_EQ(plan.orders.size(), 1u);
  EXPECT_EQ(plan.orders[0].processing.rig_id, fingerprint(moved_rig()));
  Processing redone = make_processing();
  redone.rig_id = fingerprint(moved_rig());
  ledger.add_run({{"burst", 0}}, redone, 0.1, kNow_ns + 20);
  EXPECT_EQ(plan_of(ledger, order).volumes(), 1);
  EXPECT_EQ(plan_of(ledger, order).identical.size(), 1u);
}

TEST(Reprocess, SetsAreDoneLikeTheNewestRunAndIdenticalWorkIsSkipped) {
  FilledLedger ledger(5);
  ASSERT_TRUE(*ledger.writer().add_set(make_set("dark", 0, 8, CaptureKind::Dark), {2, 0, 100}, kNow_ns));
  ReprocessOrder order;
  auto query = ledger.query();
  const auto nothing = plan_reprocessing(query, order, anything, kNow_ns);
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().code, ErrorCode::NotFound);
  ledger.add_run({{"burst", 0}}, with_solver("map"));
  order.where = "capture = burst";
  const ReprocessPlan plan = plan_of(ledger, order);
  EXPECT_EQ(plan.asked, 5);
  EXPECT_EQ(plan.identical, Ids{ledger.job({{"burst", 0}}, with_solver("map")).run_id});
  ASSERT_EQ(plan.orders.size(), 1u);
  EXPECT_EQ(plan.orders[0].sets.size(), 4u);
  EXPECT_EQ(plan.orders[0].processing.recipe.solver, "map");
  EXPECT_EQ(plan.past_runs, 1);
  EXPECT_DOUBLE_EQ(plan.seconds, 4 * 2.0);
  EXPECT_DOUBLE_EQ(plan.peak_rss_mib, 100);
}

TEST(Reprocess, RunsAreRepeatedAsTheyWereWithTheChangesLaidOver) {
  FilledLedger ledger(4);
  Processing own = with_solver("mlem");
  own.recipe.settings = {{"prepare.counts_per_unit", 10.0}, {"mlem.max_iterations", std::int64_t{5}}};
  ledger.add_run({{"burst", 0}}, own);
  ledger.add_run({{"burst", 1}, {"burst", 2}}, own);
  ReprocessOrder order;
  order.where = "solver = mlem";
  EXPECT_EQ(plan_of(ledger, order).volumes(), 0) << "nothing changed: identical";
  order.settings = {"mlem.max_iterations=9"};
  const ReprocessPlan set = plan_of(ledger, order);
  ASSERT_EQ(set.orders.size(), 2u);
  EXPECT_EQ(set.volumes(), 2);
  int means = 0;
  for (const Submit& submit : set.orders) {
    EXPECT_EQ(std::get<std::int64_t>(submit.processing.recipe.settings.at("mlem.max_iterations")), 9);
    means += submit.combine == Combine::Mean ? 1 : 0;
  }
  EXPECT_EQ(means, 1);
  order.settings.clear();
  order.recipe = "solver = \"map\"\n[map]\nbeta = 2.0\n";
  const Recipe changed = plan_of(ledger, order).orders.at(0).processing.recipe;
  EXPECT_EQ(changed.solver, "map");
  EXPECT_TRUE(changed.settings.contains("map.beta"));
  EXPECT_FALSE(changed.settings.contains("mlem.max_iterations"));
  EXPECT_DOUBLE_EQ(std::get<double>(changed.settings.at("prepare.counts_per_unit")), 10);
}

TEST(Reprocess, ASweepIsEveryCombinationOfEverySet) {
  FilledLedger ledger(3);
  for (int i = 0; i < 3; ++i) ledger.add_run({{"burst", i}});
  ReprocessOrder order;
  order.where = "solver = hessian";
  order.sweep = {"hessian.beta=1,2,3", "hessian.tolerance=0.1,0.2"};
  const ReprocessPlan plan = plan_of(ledger, order);
  EXPECT_EQ(plan.volumes(), 18);
  EXPECT_EQ(plan.orders.size(), 6u);
  const ReprocessPlan preview = preview_of(plan);
  EXPECT_EQ(preview.volumes(), 1);
  ASSERT_EQ(preview.orders.size(), 1u);
  EXPECT_EQ(preview.orders[0].sets.size(), 1u);
  EXPECT_EQ(preview.orders[0].priority, Priority::Interactive);
  EXPECT_EQ(plan.orders[0].priority, Priority::Scheduled);
}

TEST(Reprocess, FaultsAreNamedBeforeAnythingIsSubmitted) {
  FilledLedger ledger(1);
  ledger.add_run({{"burst", 0}});
  auto query = ledger.query();
  const auto fault = [&](const ReprocessOrder& order) {
    const auto plan = plan_reprocessing(query, order, anything, kNow_ns);
    return plan ? std::string("accepted") : plan.error().message;
  };
  EXPECT_NE(fault({.where = "solvr = map", .rig_id = {}, .recipe = {}, .settings = {}, .sweep = {}})
                .find("character 1:"),
            std::string::npos);
  EXPECT_NE(
      fault({.where = {}, .rig_id = {}, .recipe = "solver = ", .settings = {}, .sweep = {}}).find("recipe"),
      std::string::npos);
  EXPECT_NE(fault({.where = {}, .rig_id = {}, .recipe = {}, .settings = {"no.such=1"}, .sweep = {}})
                .find("no.such"),
            std::string::npos);
  EXPECT_NE(fault({.where = {}, .rig_id = {}, .recipe = {}, .settings = {}, .sweep = {"x"}}).find("sweep"),
            std::string::npos);
  EXPECT_FALSE(sweep_combinations({"a.b=1,,2"}));
  EXPECT_EQ(sweep_combinations({})->size(), 1u);
}

TEST(Retirement, FilesGoRecordsStayAndTheWorkCanBeAskedForAgain) {
  FilledLedger ledger(2);
  const std::string run = ledger.add_run({{"burst", 0}});
  ASSERT_TRUE(ledger.writer().put_metrics({run, {{"kept", 1}}}));
  EXPECT_FALSE(ledger.writer().add_job(ledger.job({{"burst", 0}}), 0)->has_value()) << "identical";
  const auto files = ledger.writer().retire({{run}}, kNow_ns);
  ASSERT_TRUE(files) << files.error().message;
  EXPECT_EQ(*files, Ids{"volumes/" + run + ".vtkhdf"});
  EXPECT_EQ(*ledger.writer().retired_files(), *files);
  EXPECT_TRUE(ledger.query().work(Filter{}, 10)->at(0).retired);
  ReprocessOrder again;
  again.where = "index = 0";
  EXPECT_EQ(plan_of(ledger, again).volumes(), 1);
  // Made again: the same run, its metrics as before, and its file counts again.
  EXPECT_EQ(ledger.add_run({{"burst", 0}}, make_processing(), 0.2), run);
  EXPECT_TRUE(ledger.writer().retired_files()->empty());
  const auto rows = ledger.query().work(Filter{}, 10);
  ASSERT_EQ(rows->size(), 1u);
  EXPECT_FALSE(rows->at(0).retired);
  EXPECT_DOUBLE_EQ(rows->at(0).run.residual, 0.2);
  EXPECT_DOUBLE_EQ(rows->at(0).run.metrics.at("kept"), 1);
  EXPECT_FALSE(ledger.writer().retire({{"unknown"}}, kNow_ns));
}

TEST(Schedules, AreKeptWithWhatBecameOfThem) {
  FilledLedger ledger(1);
  Schedule schedule;
  schedule.name = "nightly";
  schedule.cron = "0 2 * * *";
  schedule.order.where = "residual > 0.1";
  schedule.created_time_ns = kNow_ns;
  ASSERT_TRUE(ledger.writer().put_schedule(schedule));
  const auto job = ledger.writer().add_job(ledger.job({{"burst", 0}}), 0);
  ASSERT_TRUE(
      ledger.writer().schedule_ran({"nightly", kNow_ns + 5, kNow_ns + 6, "submitted", "1 job", {**job}}));
  const auto rows = ledger.query().schedules();
  ASSERT_TRUE(rows) << rows.error().message;
  ASSERT_EQ(rows->size(), 1u);
  EXPECT_EQ(rows->at(0).schedule.order.where, "residual > 0.1");
  EXPECT_EQ(rows->at(0).schedule.last_due_ns, kNow_ns + 5);
  EXPECT_EQ(rows->at(0).jobs_left, 1);
  EXPECT_EQ(rows->at(0).last_outcome, "submitted");
  EXPECT_FALSE(ledger.writer().schedule_ran({"other", 1, 1, "missed", "", {}}));
  ASSERT_TRUE(ledger.writer().drop_schedule("nightly"));
  EXPECT_FALSE(ledger.writer().drop_schedule("nightly"));
  EXPECT_TRUE(ledger.query().schedules()->empty());
}

}  // namespace
}  // namespace flamefield
