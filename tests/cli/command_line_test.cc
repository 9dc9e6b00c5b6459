#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace flamefield {
namespace {

TEST(Program, ExplainsEveryCommandWithAnExample) {
  const Scratch scratch;
  for (const char* command : {"phantom", "ring", "render", "prepare", "reconstruct", "evaluate", "show",
                              "convert", "calibrate solve", "calibrate check"}) {
    const ProgramResult result = flamefield(scratch.path(), std::string(command) + " --help");
    EXPECT_EQ(result.exit_code, 0) << command;
    EXPECT_TRUE(contains(result.out, "Example")) << result.out;
    EXPECT_TRUE(contains(result.out, std::string("flamefield ") + command)) << result.out;
  }
  EXPECT_TRUE(contains(flamefield(scratch.path(), "--version").out, "flamefield 0."));
}

TEST(Program, AnswersMistakesOfTheCommandLineWithExitCodeTwo) {
  const Scratch scratch;
  const std::vector<std::pair<std::string, std::string>> mistakes = {
      {"recontsruct", "did you mean 'reconstruct'?"},
      {"phantom trous --size 8,8,8 --out a.npy", "did you mean 'torus'?"},
      {"phantom torus --size 8,8 --out a.npy", "--size"},
      {"phantom torus --size 8,8,-8 --out a.npy", "8x8x-8"},
      {"phantom torus --size 8,8,8", "--out"},
      {"phantom torus --size 8,8,8 --spacing-mm 0 --out a.npy", "spacing"},
      {"phantom torus --size 8,8,8 --out a.npy --colour blue", "--colour"},
      {"evaluate --truth", "--truth"},
      {"", "flamefield --help"}};
  for (const auto& [arguments, part] : mistakes) {
    const ProgramResult result = flamefield(scratch.path(), arguments);
    EXPECT_EQ(result.exit_code, 2) << arguments << ": " << result.err;
    EXPECT_TRUE(contains(result.err, part)) << arguments << ": " << result.err;
    EXPECT_TRUE(contains(result.err, " (") && contains(result.err, ") ")) << result.err;
  }
  EXPECT_TRUE(scratch.is_empty());
}

// A flame that nobody drew: computed heat release of a V-flame.
TEST(Program, RecoversAComputedFlame) {
  const Scratch scratch;
  const ProgramResult chain = shell(
      scratch.path(), "\"$F\" ring --views 12 --spacing-deg 15 --radius-mm 300 --volume " FLAMEFIELD_TEST_DATA
                      "/vflame_small.npy --spacing-mm 1 --image 28,28 --out rig.yaml && "
                      "\"$F\" render --volume " FLAMEFIELD_TEST_DATA
                      "/vflame_small.npy --rig rig.yaml --out p.nxs && "
                      "\"$F\" reconstruct --projections p.nxs --rig rig.yaml --size 28,28,28 --spacing-mm 2 "
                      "--out v.vtkhdf && "
                      "\"$F\" evaluate --truth " FLAMEFIELD_TEST_DATA
                      "/vflame_small.npy --volume v.vtkhdf --spacing-mm 1 --json");
  ASSERT_EQ(chain.exit_code, 0) << chain.err;
  EXPECT_GT(json_number(chain.out, "pearson_3d"), 0.9);
}

}  // namespace
}  // namespace flamefield
