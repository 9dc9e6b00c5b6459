#include <gtest/gtest.h>

#include <algorithm>

#include "tests/cli/program.h"

namespace flamefield {
namespace {

constexpr const char* kSmall = R"(title = "Noise and views"
[phantom]
kind = "torus"
size = [14, 14, 14]
[run]
keep_volumes = true
[sweep]
images.noise = [0.0, 0.02]
[[case]]
name = "MLEM"
solver = "mlem"
mlem.max_iterations = 20
[[case]]
name = "SIRT"
solver = "sirt"
sirt.max_iterations = 20
[[figure]]
kind = "errors"
over = "images.noise"
[[figure]]
kind = "slices"
[[figure]]
kind = "height"
[[figure]]
kind = "scatter"
[[figure]]
kind = "masks"
samples = 20000
[[finding]]
claim = "Less noise is better"
over = "images.noise"
better_when = "low"
measures = ["pearson"]
)";

TEST(StudyCommand, SweepsWritesResultsAndGoesOn) {
  const Scratch scratch;
  overwrite(scratch / "s.toml", kSmall);
  const ProgramResult made = flamefield(scratch.path(), "study s.toml --out out --json");
  ASSERT_EQ(made.exit_code, 0) << made.err;
  EXPECT_EQ(json_number(made.out, "done"), 4);
  EXPECT_TRUE(contains(made.out, "\"verdict\": \"holds\"")) << made.out;
  const std::string csv = *read_text_file(scratch / "out/results.csv");
  EXPECT_EQ(std::count(csv.begin(), csv.end(), '\n'), 5);
  const std::string html = *read_text_file(scratch / "out/report.html");
  for (const char* part :
       {"Noise and views", "SqMD", "height above burner HAB y (mm)", "histogram, top view"})
    EXPECT_TRUE(contains(html, part)) << part;
  for (const char* outside : {"http://fonts", "https://", "<script", "src=\"/"})
    EXPECT_FALSE(contains(html, outside)) << outside;
  const ProgramResult again = flamefield(scratch.path(), "study s.toml --out out --resume --json");
  EXPECT_EQ(json_number(again.out, "skipped"), 4) << again.err;
  EXPECT_EQ(*read_text_file(scratch / "out/results.csv"), csv);
}

TEST(StudyCommand, ResultsDoNotDependOnTheNumberOfJobs) {
  const Scratch scratch;
  overwrite(scratch / "s.toml", kSmall);
  const std::string without_times = " && sed -E 's/,[^,]*,([0-9]+,[a-z ]+,[0-9a-f]+)$/,\\1/' ";
  const ProgramResult one =
      shell(scratch.path(), "\"$F\" study s.toml --out a --jobs 1 > log" + without_times + "a/results.csv");
  const ProgramResult two =
      shell(scratch.path(), "\"$F\" study s.toml --out b --jobs 2 > log" + without_times + "b/results.csv");
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_EQ(one.out, two.out);
}

TEST(StudyCommand, AKilledStudyGoesOnWhereItWas) {
  const Scratch scratch;
  overwrite(scratch / "s.toml", R"(solver = "ert"
[phantom]
kind = "torus"
size = [14, 14, 14]
[ert]
max_generations = 3000
[sweep]
solve.seed = { from = 1, to = 12, step = 1 }
)");
  // Killed as soon as the third record stands.
  const ProgramResult cut =
      shell(scratch.path(),
            "\"$F\" study s.toml --jobs 2 --out out 2> log & p=$!; "
            "for i in $(seq 2000); do [ $(ls out/runs 2>/dev/null | grep -c json$) -ge 3 ] && break; "
            "sleep 0.01; done; kill -9 $p; wait $p 2> log; ls out/runs | grep -c json$");
  const ProgramResult rest = flamefield(scratch.path(), "study s.toml --out out --resume --json");
  ASSERT_EQ(rest.exit_code, 0) << rest.err;
  EXPECT_GE(json_number(rest.out, "skipped"), 3);
  EXPECT_EQ(json_number(rest.out, "skipped") + json_number(rest.out, "done"), 12);
}

TEST(StudyCommand, RefusesWhatItCannotDo) {
  const Scratch scratch;
  overwrite(scratch / "s.toml", kSmall);
  const auto refused = [&](const std::string& arguments, int code, const std::string& part) {
    const ProgramResult result = flamefield(scratch.path(), "study " + arguments);
    EXPECT_EQ(result.exit_code, code) << arguments << '\n' << result.err;
    EXPECT_TRUE(contains(result.err, part)) << part << " in: " << result.err;
  };
  refused("papers", 2, "did you mean 'paper'?");
  refused("s.toml --resume --out new", 2, "nothing to resume");
  refused("s.toml --out s.toml", 1, "cannot be made");
  refused("s.toml --set mlem.max_iteration=3", 2, "did you mean 'mlem.max_iterations'?");
  refused("", 2, "--list");
  EXPECT_EQ(scratch.entries(), 1u);
}

TEST(StudyCommand, ADryRunListsTheRunsAndDoesNone) {
  const Scratch scratch;
  overwrite(scratch / "s.toml", kSmall);
  const ProgramResult result = flamefield(scratch.path(), "study s.toml --dry-run --out out");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_TRUE(contains(result.out, "4 of 4 runs to do")) << result.out;
  EXPECT_TRUE(contains(result.out, "SIRT, noise 0.02")) << result.out;
  EXPECT_EQ(scratch.entries(), 1u);
}

}  // namespace
}  // namespace flamefield
