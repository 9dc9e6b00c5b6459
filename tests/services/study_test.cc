#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <set>

#include "reconstruct/render.h"
#include "services/store/file.h"
#include "services/store/npy.h"
#include "services/study/findings.h"
#include "services/study/runner.h"
#include "services/study/study_file.h"
#include "tests/support/scratch.h"

namespace flamefield {
namespace {

std::vector<Study> studies_of(const Scratch& scratch, const std::string& text,
                              const StudyOptions& options = {}) {
  overwrite(scratch / "s.toml", text);
  auto studies = read_studies((scratch / "s.toml").string(), options);
  EXPECT_TRUE(studies) << studies.error().message;
  return studies.value_or(std::vector<Study>());
}
StudyPlan plan_of(const std::vector<Study>& studies) {
  FieldFiles fields;
  auto plan = plan_runs(studies, fields);
  EXPECT_TRUE(plan) << plan.error().message;
  return plan.value_or(StudyPlan());
}
std::string fault_of(const std::string& text) {
  const Scratch scratch;
  overwrite(scratch / "s.toml", text);
  auto studies = read_studies((scratch / "s.toml").string(), {});
  if (!studies) return studies.error().message;
  FieldFiles fields;
  const auto plan = plan_runs(*studies, fields);
  return plan ? "" : plan.error().message;
}
bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

constexpr const char* kTiny = R"(
solver = "mlem"
[phantom]
kind = "torus"
size = [12, 12, 12]
finer = 1
[images]
pixel_samples = 1
)";

TEST(Study, SweepsEveryCombinationOfAxesCasesAndSeeds) {
  const Scratch scratch;
  const auto studies = studies_of(scratch, std::string(kTiny) + R"(
[sweep]
mlem.max_iterations = [2, 4, 8]
images.noise = { from = 0.0, to = 0.02, step = 0.01 }
[[case]]
name = "few"
cameras.views = 4
[[case]]
name = "many"
)");
  ASSERT_EQ(studies.size(), 1u);
  Study study = studies.front();
  study.repeats = 2;
  const StudyPlan plan = plan_of({study});
  EXPECT_EQ(plan.runs.size(), 3u * 3u * 2u * 2u);
  std::set<std::string> ids, labels;
  for (const StudyRun& run : plan.runs) {
    ids.insert(run.id), labels.insert(run.label());
    EXPECT_EQ(run.settings.views, run.case_name == "few" ? 4 : 8);
    EXPECT_EQ(run.settings.nx, 12);
  }
  EXPECT_EQ(ids.size(), plan.runs.size());
  EXPECT_EQ(labels.size(), plan.runs.size());
}

TEST(Study, WhatIsSweptTogetherGoesInStep) {
  const Scratch scratch;
  const auto plan = plan_of(studies_of(scratch, std::string(kTiny) + R"(
[together]
cameras.views = [4, 8, 16]
cameras.spacing_deg = [45.0, 22.5, 11.25]
)"));
  ASSERT_EQ(plan.runs.size(), 3u);
  for (const StudyRun& run : plan.runs) EXPECT_DOUBLE_EQ(run.settings.views * run.settings.spacing_deg, 180);
}

TEST(Study, EqualRunsAreDoneOnce) {
  const Scratch scratch;
  const auto plan = plan_of(studies_of(scratch, std::string(kTiny) + "[sweep]\nert.sigma = [0.1, 0.2]\n"));
  ASSERT_EQ(plan.runs.size(), 2u);  // mlem never reads it
  EXPECT_EQ(plan.runs[0].id, plan.runs[1].id);
  ASSERT_EQ(plan.notes.size(), 1u);
}

TEST(Study, AnIdFollowsEverySettingThatMatters) {
  FieldFiles fields;
  const auto id = [&](const Settings& settings) { return read_run_settings(settings, ".", fields)->id(); };
  const Settings base = {{"phantom.kind", "bunsen"}, {"solver", "ert"}};
  std::set<std::string> ids = {id(base)};
  const auto differs = [&](const std::string& key, const Setting& value) {
    Settings changed = base;
    changed[key] = value;
    EXPECT_TRUE(ids.insert(id(changed)).second) << key;
  };
  differs("phantom.kind", "swirl");
  differs("phantom.seed", std::int64_t{2});
  differs("phantom.time_s", 0.1);
  differs("phantom.nx", std::int64_t{49});
  differs("cameras.views", std::int64_t{22});
  differs("cameras.spacing_deg", 7.5000001);
  differs("images.noise", 0.01);
  differs("solver", "mlem");
  differs("ert.sigma", 0.111);
  differs("constraints.visual_hull", true);
  differs("solve.seed", std::int64_t{2});
  differs("solve.time_limit_s", 5.0);
  Settings irrelevant = base;
  irrelevant["mlem.max_iterations"] = std::int64_t{3};
  EXPECT_EQ(id(irrelevant), id(base));
}

TEST(Study, TakesTheSetUpsOfTheArticle) {
  FieldFiles fields;
  const auto swirl = read_run_settings({{"phantom.kind", "swirl"}}, ".", fields);
  ASSERT_TRUE(swirl);
  EXPECT_EQ(std::vector<int>({swirl->nx, swirl->ny, swirl->nz}), std::vector<int>({66, 43, 66}));
  EXPECT_EQ(swirl->views, 24);
  EXPECT_DOUBLE_EQ(swirl->spacing_deg, 7.5);
}

TEST(Study, FaultsNameLineAndNearestName) {
  EXPECT_TRUE(contains(fault_of("solver = \"mlem\"\n[phantom]\nkin = \"torus\"\n"), "s.toml:3:"));
  EXPECT_TRUE(contains(fault_of("[phantom]\nkin = \"torus\"\n"), "did you mean 'phantom.kind'?"));
  EXPECT_TRUE(contains(fault_of("[phantom]\nkind = \"taurus\"\n"), "did you mean 'torus'?"));
  EXPECT_TRUE(contains(fault_of("[camera]\nviews = 3\n"), "did you mean 'cameras'?"));
  EXPECT_TRUE(
      contains(fault_of("[sweep]\nmlem.max_iteration = [1, 2]\n"), "did you mean 'mlem.max_iterations'?"));
  EXPECT_TRUE(contains(fault_of("[sweep]\nmlem.max_iterations = [1, -2]\n"), "s.toml:2:"));
  EXPECT_TRUE(contains(fault_of("recipe = \"ctk\"\n"), "did you mean 'ctc'?"));
  EXPECT_TRUE(contains(fault_of("titel = \"x\"\n"), "did you mean 'title'?"));
  EXPECT_TRUE(contains(fault_of("[[figure]]\nkind = \"path\"\n"), "did you mean 'paths'?"));
  EXPECT_TRUE(contains(
      fault_of("[sweep]\ncameras.views = [4, 8]\n[[figure]]\nkind = \"paths\"\nover = \"cameras.view\"\n"),
      "did you mean 'cameras.views'?"));
}

TEST(Study, RefusesEmptyAndUnevenSweeps) {
  EXPECT_TRUE(contains(fault_of("[sweep]\ncameras.views = []\n"), "is empty"));
  EXPECT_TRUE(contains(fault_of("[sweep]\nimages.noise = { from = 1.0, to = 0.0, step = 0.1 }\n"),
                       "empty or endless"));
  EXPECT_TRUE(contains(fault_of("[sweep]\nimages.noise = { from = 1.0, to = 0.0 }\n"), "not clear"));
  EXPECT_TRUE(contains(fault_of("[together]\ncameras.views = [1, 2]\nimages.noise = [0.1]\n"), "one length"));
  EXPECT_TRUE(contains(fault_of("[[case]]\nsolver = \"mlem\"\n"), "has no name"));
}

TEST(Study, AFieldFromAFileIsReconstructedOnACoarserGrid) {
  const Scratch scratch;
  FieldFiles fields;
  const Settings settings = {{"phantom.field", std::string(FLAMEFIELD_TEST_DATA "/vflame_small.npy")},
                             {"phantom.field_spacing_mm", 1.0}};
  const auto run = read_run_settings(settings, scratch.path(), fields);
  ASSERT_TRUE(run) << run.error().message;
  EXPECT_EQ(std::vector<int>({run->nx, run->ny, run->nz}), std::vector<int>({28, 28, 28}));
  EXPECT_DOUBLE_EQ(run->spacing_mm, 2);
  const auto scene = make_scene(*run, fields, 1);
  ASSERT_TRUE(scene) << scene.error().message;
  double fine = 0, coarse = 0;
  const auto field = fields.get(settings.find("phantom.field")->second.index() == 3
                                    ? std::get<std::string>(settings.find("phantom.field")->second)
                                    : "",
                                1.0);
  for (float v : (*field)->volume.values) fine += v;
  for (float v : scene->truth.values) coarse += v * 8.0;
  EXPECT_NEAR(coarse / fine, 1, 1e-5);  // averaging keeps what there is
}

TEST(Study, FaultsOfFieldsNameTheFile) {
  const Scratch scratch;
  const auto fault = [&](const std::string& name) {
    FieldFiles fields;
    const auto run = read_run_settings({{"phantom.field", name}}, scratch.path(), fields);
    return run ? std::string() : run.error().message;
  };
  EXPECT_TRUE(contains(fault("missing.npy"), "missing.npy"));
  overwrite(scratch / "noise.npy", "not a field at all");
  EXPECT_TRUE(contains(fault("noise.npy"), "noise.npy"));
  ASSERT_TRUE(write_npy(scratch / "dark.npy", {4, 4, 4}, std::vector<float>(64, 0)));
  EXPECT_TRUE(contains(fault("dark.npy"), "nothing to reconstruct"));
  std::vector<float> broken(64, 1);
  broken[5] = NAN;
  ASSERT_TRUE(write_npy(scratch / "nan.npy", {4, 4, 4}, broken));
  EXPECT_TRUE(contains(fault("nan.npy"), "voxel x=1, y=1, z=0"));
}

// A finished run with given value of a swept key, fitness and distance.
FinishedRun finished(double value, double fitness, double sqmd, const std::string& case_name = "") {
  FinishedRun run;
  run.run.case_name = case_name;
  run.run.flat = {{"ert.mutation_rate", value}, {"ert.annihilation_rate", 0.3}};
  run.run.swept = {{"ert.mutation_rate", value}};
  run.record.metrics.pearson = fitness;
  run.record.metrics.sqmd = sqmd;
  run.record.history = {{0, 1, 0, 0.5}, {50, 1, 0, 0.9 * fitness}, {100, 1, 0, fitness}};
  return run;
}

Outcome verdict_of(const std::vector<FinishedRun>& runs, StudyFinding::Rule rule) {
  StudyFinding finding;
  finding.over = "ert.mutation_rate";
  finding.rule = rule;
  finding.than = rule == StudyFinding::Rule::Above ? "ert.annihilation_rate" : "old";
  finding.better = "new";
  StudyResults results;
  results.runs = runs;
  return judge(results, finding).verdict;
}

TEST(Finding, IsJudgedByItsRunsAlone) {
  using Rule = StudyFinding::Rule;
  const std::vector<FinishedRun> falling = {finished(0.1, 0.99, 0.1), finished(0.5, 0.97, 0.1),
                                            finished(0.9, 0.95, 0.1)};
  EXPECT_EQ(verdict_of(falling, Rule::Falls), Outcome::Holds);
  EXPECT_EQ(verdict_of(falling, Rule::Rises), Outcome::Fails);
  EXPECT_EQ(verdict_of(falling, Rule::Above), Outcome::Fails);  // 0.5 and 0.9 are above 0.3
  EXPECT_EQ(verdict_of({finished(0, 0.95, 0.1, "old"), finished(0, 0.96, 0.1, "new")}, Rule::Cases),
            Outcome::Holds);
  EXPECT_EQ(verdict_of({finished(0, 0.95, 0.1, "old")}, Rule::Cases), Outcome::NoData);
  EXPECT_EQ(verdict_of({}, Rule::Falls), Outcome::NoData);
}

TEST(Finding, ADifferenceWithinTheScatterOfSeedsIsNone) {
  using Rule = StudyFinding::Rule;
  EXPECT_EQ(verdict_of({finished(0.1, 0.95, 0), finished(0.1, 0.99, 0), finished(0.9, 0.94, 0),
                        finished(0.9, 0.985, 0)},
                       Rule::Falls),
            Outcome::Unclear);
  EXPECT_EQ(verdict_of({finished(0.1, 0.989, 0), finished(0.1, 0.99, 0), finished(0.9, 0.94, 0),
                        finished(0.9, 0.942, 0)},
                       Rule::Falls),
            Outcome::Holds);
}

TEST(Finding, SpreadIsThatOfASample) {
  const Spread s = spread_of({1, 2, 3, 4, NAN});
  EXPECT_EQ(s.count, 4u);
  EXPECT_DOUBLE_EQ(s.mean, 2.5);
  EXPECT_NEAR(s.sd, std::sqrt(5.0 / 3), 1e-12);
}

TEST(StudyRecord, SurvivesTheWayToDiskAndBack) {
  RunRecord record = finished(0.1, 0.97, 0.2).record;
  record.id = "abc", record.notes = {"a \"note\""};
  record.metrics.slices[1] = {{0, NAN, 0.5}, {1, 0.25, NAN}};
  const auto back = record_from_json(json_of(record));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(json_of(*back), json_of(record));
  EXPECT_TRUE(std::isnan(back->metrics.slices[1][0].pearson));
  EXPECT_EQ(back->history.size(), 3u);
}

TEST(StudyRecord, ADamagedOneIsNoRecord) {
  const Scratch scratch;
  const auto store = RecordStore::open(scratch.path());
  ASSERT_TRUE(store);
  RunRecord record = finished(0.1, 0.97, 0.2).record;
  record.id = "abc";
  ASSERT_TRUE(store->put(record));
  EXPECT_TRUE(store->find("abc"));
  const std::string text = *read_text_file(scratch / "runs/abc.json");
  for (std::size_t length : {std::size_t{0}, text.size() / 2, text.size() - 3}) {
    overwrite(scratch / "runs/abc.json", text.substr(0, length));
    EXPECT_FALSE(store->find("abc")) << length;
  }
}

class RunnerOfATinyStudy : public testing::Test {
 protected:
  Scratch scratch;
  std::vector<Study> studies =
      studies_of(scratch, std::string(kTiny) + "[sweep]\nmlem.max_iterations = [1, 2, 3, 4]\n");
  StudyPlan plan = plan_of(studies);
  FieldFiles fields;
  StudyScenes scenes{fields};
  RecordStore store = *RecordStore::open(scratch / "out");

  RunnerSummary go(int jobs, std::stop_token stop = {}) {
    const auto summary = do_runs(studies, plan, store, scenes, {.jobs = jobs}, stop);
    EXPECT_TRUE(summary) << summary.error().message;
    return summary.value_or(RunnerSummary{});
  }
};

TEST_F(RunnerOfATinyStudy, DoesEachRunOnceAndGoesOnWhereItWasCutOff) {
  EXPECT_EQ(go(2).done, 4u);
  const RunRecord first = *store.find(plan.runs[0].id);
  EXPECT_GT(store.find(plan.runs[3].id)->metrics.pearson, first.metrics.pearson);
  EXPECT_EQ(go(2).skipped, 4u);
  // As a kill would leave it: one record missing, one half written.
  store.remove(plan.runs[0].id);
  overwrite(scratch / ("out/runs/" + plan.runs[1].id + ".json"), "{\"format\": ");
  const RunnerSummary again = go(1);
  EXPECT_EQ(again.done, 2u);
  EXPECT_EQ(again.skipped, 2u);
  EXPECT_EQ(store.find(plan.runs[0].id)->metrics.pearson, first.metrics.pearson);
}

TEST_F(RunnerOfATinyStudy, AStopKeepsNothingHalfDone) {
  std::stop_source source;
  source.request_stop();
  const RunnerSummary summary = go(2, source.get_token());
  EXPECT_TRUE(summary.stopped);
  EXPECT_EQ(summary.done, 0u);
  EXPECT_EQ(go(2).done, 4u);
}

TEST_F(RunnerOfATinyStudy, AFullOrReadOnlyDiskEndsIt) {
  std::filesystem::remove_all(scratch / "out");
  overwrite(scratch / "out", "a file where a folder was");
  const auto summary = do_runs(studies, plan, store, scenes, {.jobs = 2}, {});
  ASSERT_FALSE(summary);
  EXPECT_FALSE(RecordStore::open(scratch / "out"));
}

TEST(Study, EveryShippedOneCanBeRead) {
  const auto names = shipped_studies();
  EXPECT_GE(names.size(), 8u);
  for (const std::string& name : names)
    for (bool quick : {false, true}) {
      const auto studies = read_studies(name, {.quick = quick});
      ASSERT_TRUE(studies) << studies.error().message;
      EXPECT_GE(plan_of(*studies).runs.size(), 1u) << name;
    }
}

TEST(Study, CsvQuotesWhatNeedsIt) {
  StudyResults part;
  part.study.name = "a,b";
  part.runs = {finished(0.1, 0.9, 0.2, "say \"x\"")};
  const std::string csv = csv_of({part});
  EXPECT_TRUE(contains(csv, "\"a,b\",\"say \"\"x\"\"\""));
  EXPECT_TRUE(contains(csv, ",0.1,"));
}

}  // namespace
}  // namespace flamefield
