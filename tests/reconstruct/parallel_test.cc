#include "reconstruct/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace flamefield {
namespace {

TEST(Team, RunsEveryBlockOnceInEveryRound) {
  Team team(3);
  EXPECT_EQ(team.threads(), 3);
  for (int round = 0; round < 200; ++round) {
    std::vector<int> hits(37, 0);
    team.run(hits.size(), [&](std::size_t i) { ++hits[i]; });
    EXPECT_EQ(hits, std::vector<int>(37, 1));
  }
}

TEST(Team, RangesCoverTheCountWithoutOverlap) {
  Team team(2);
  std::vector<int> hits(101, 0);
  team.run_ranges(hits.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) ++hits[i];
  });
  EXPECT_EQ(hits, std::vector<int>(101, 1));
  team.run_ranges(0, 8, [&](std::size_t, std::size_t) { FAIL(); });
}

TEST(Team, AnExceptionReachesTheCallerAndTheTeamLivesOn) {
  Team team(3);
  EXPECT_THROW(team.run(20,
                        [](std::size_t i) {
                          if (i == 7) throw std::runtime_error("seven");
                        }),
               std::runtime_error);
  std::atomic<int> sum = 0;
  team.run(5, [&](std::size_t i) { sum += static_cast<int>(i); });
  EXPECT_EQ(sum, 10);
}

}  // namespace
}  // namespace flamefield
