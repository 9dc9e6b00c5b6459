#include "tests/services/chaos.h"

#include <gtest/gtest.h>

#include <fstream>
#include <random>

#include "tests/support/scratch.h"
#include "tests/support/slowdown.h"

namespace flamefield::testing_support {

Process::Process(const std::string& program, const std::vector<std::string>& arguments,
                 const std::filesystem::path& log)
    : child_(ChildProcess::start(std::filesystem::path(FLAMEFIELD_BIN) / program, arguments, log).value()) {}

void expect_survival(ChaosOptions options) {
  const Scratch scratch;
  options.programs = FLAMEFIELD_BIN;
  options.directory = scratch.path();
  options.seed = std::random_device()();
  options.rate_hz /= kSlowdown;
  options.iterations /= kSlowdown;
  SCOPED_TRACE(concat("seed ", options.seed));
  const auto result = run_chaos(options, {}, [](int) {});
  if (result) {
    EXPECT_EQ(result->lost, 0);
    EXPECT_EQ(result->committed_twice, 0);
    EXPECT_TRUE(result->balances);
    for (const std::string& problem : result->problems) ADD_FAILURE() << problem;
    EXPECT_EQ(result->dispatcher_kills, options.dispatcher_kills);
    EXPECT_EQ(result->worker_kills, options.worker_kills);
  } else {
    ADD_FAILURE() << result.error().message;
  }
  if (::testing::Test::HasFailure()) std::cerr << std::ifstream(scratch / "log").rdbuf();
}

}  // namespace flamefield::testing_support
