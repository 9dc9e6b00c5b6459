#include <gtest/gtest.h>

#include "tests/cli/program.h"

namespace flamefield {
namespace {

TEST(SelfTest, NeedsToBeToldWhich) {
  const Scratch scratch;
  EXPECT_EQ(flamefield(scratch.path(), "selftest").exit_code, 2);
}

TEST(Jobs, ControlNeedsToBeToldWhichJobs) {
  const Scratch scratch;
  const ProgramResult result = flamefield(scratch.path(), "jobs cancel");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_TRUE(contains(result.err, "no job was named")) << result.err;
}

}  // namespace
}  // namespace flamefield
