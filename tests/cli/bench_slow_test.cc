#include <gtest/gtest.h>

#include "tests/cli/program.h"
#include "tests/support/slowdown.h"

namespace flamefield {
namespace {

ProgramResult bench(const std::string& arguments) {
  const Scratch scratch;
  return flamefield(scratch.path(), "bench " + arguments);
}

TEST(Bench, MeasuresTheProjectorAgainstTheMachine) {
  const ProgramResult result =
      bench("projector --case A --size 16,18,16 --views 4 --threads 1,2 --seconds 0 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  const double forward = json_number(result.out, "forward_cpu_s"),
               rate = json_number(result.out, "samples_per_cpu_s"),
               limit = json_number(result.out, "limit_samples_per_cpu_s");
  EXPECT_GT(forward, 0);
  EXPECT_GT(json_number(result.out, "adjoint_cpu_s"), 0);
  EXPECT_LT(json_number(result.out, "adjoint_mismatch"), 1e-5);
  EXPECT_EQ(json_number(result.out, "samples"), 4 * 16 * 18 * 16);
  EXPECT_NEAR(rate * forward, 4 * 16 * 18 * 16, 1);
  EXPECT_GT(limit, 1e8);
  EXPECT_LT(rate, limit);
  EXPECT_GT(json_number(result.out, "peak_rss_mib"), 1);
  EXPECT_TRUE(contains(result.out, "\"engine\"")) << result.out;
  EXPECT_TRUE(contains(result.err, "adjoint, 2 threads")) << result.err;
}

TEST(Bench, PrintsATableWithUnits) {
  const ProgramResult result = bench("projector --size 12,12,12 --views 3 --threads 1 --seconds 0");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* part : {"forward (CPU-s)", "samples/CPU-s", "adjoint mismatch", "MiB", "limit"})
    EXPECT_TRUE(contains(result.out, part)) << part << " in " << result.out;
}

TEST(Bench, MeasuresTheQueueAndALargeLedger) {
  const ProgramResult result = bench("queue --jobs 60 --runs 300 --workers 2 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_number(result.out, "jobs"), 60);
  for (const char* figure : {"submit_s", "done_s", "job_wall_ms", "job_cpu_ms", "newest 1000", "receipt"})
    EXPECT_GT(json_number(result.out, figure), 0) << figure;
}

TEST(Bench, TimesSolversToATarget) {
  const ProgramResult result = bench(
      "solvers --solver mlem,sirt --size 14,14,14 --views 6 --spacing-deg 30 --noise 0 --target 0.8 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(contains(result.out, "\"solver\": \"mlem\"")) << result.out;
  EXPECT_TRUE(contains(result.out, "\"solver\": \"sirt\"")) << result.out;
  EXPECT_TRUE(contains(result.out, "\"reached\": true")) << result.out;
  EXPECT_GE(json_number(result.out, "pearson"), 0.8);
  EXPECT_GT(json_number(result.out, "wall_s"), 0);
  EXPECT_GE(json_number(result.out, "iterations"), 2);
}

TEST(Bench, SkipsSizesThatDoNotFitAndSaysWhy) {
  const ProgramResult result =
      bench("scaling --sizes 8,400 --views 2,3 --middle 8 --seconds 0 --memory-mib 100 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(contains(result.out, "\"skipped\": \"needs ")) << result.out;
  EXPECT_GT(json_number(result.out, "forward_cpu_s"), 0);
}

TEST(Bench, CountsTheOffspringOfTheEvolutionarySolver) {
  const ProgramResult result =
      bench(concat("ert --size 12,12,12 --views 4 --json --seconds ", 0.3 * testing_support::kSlowdown));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_GT(json_number(result.out, "offspring_per_s"), 10);
  for (const char* scheme : {"brood", "images from the parents'", "rendered by the ray tracer"})
    EXPECT_TRUE(contains(result.out, scheme)) << result.out;
}

TEST(Bench, RunsFrameSetsThroughThePipeline) {
  const Scratch scratch;
  const ProgramResult result = flamefield(scratch.path(),
                                          "bench pipeline --cameras 4 --image 40,40 --size 10,10,10 --sets 3 "
                                          "--threads 1 --folder . --solver mlem --set "
                                          "mlem.max_iterations=3 --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_number(result.out, "failed"), 0);
  for (const char* key : {"sets_per_s", "put_p99_ms", "volumes_per_s", "prepare_ms", "solve_ms", "set_mib"})
    EXPECT_GT(json_number(result.out, key), 0) << key;
  EXPECT_TRUE(scratch.is_empty());
}

TEST(Bench, RefusesWhatItDoesNotKnow) {
  EXPECT_EQ(bench("projector --case D").exit_code, 2);
  EXPECT_EQ(bench("solvers --solver mlme").exit_code, 2);
  EXPECT_EQ(bench("solvers --phantom candle").exit_code, 2);
  EXPECT_EQ(bench("").exit_code, 2);
}

}  // namespace
}  // namespace flamefield
