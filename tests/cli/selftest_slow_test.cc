#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace flamefield {
namespace {

TEST(SelfTest, LosesNothingWhileProgramsDieAndSaysSoInJson) {
  const Scratch scratch;
  const ProgramResult result =
      flamefield(scratch.path(), "selftest --chaos --sets 30 --rate-hz 15 --seed 3 --folder . --json");
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_EQ(json_number(result.out, "sets"), 30);
  EXPECT_EQ(json_number(result.out, "lost"), 0);
  EXPECT_EQ(json_number(result.out, "committed_twice"), 0);
  EXPECT_EQ(json_number(result.out, "kills"), 13);
  EXPECT_TRUE(scratch.is_empty()) << "what succeeded leaves nothing behind";
}

}  // namespace
}  // namespace flamefield
