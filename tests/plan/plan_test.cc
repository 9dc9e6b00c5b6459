#include "services/plan/plan.h"

#include <gtest/gtest.h>

namespace flamefield {
namespace {

// Round figures: a voxel takes 1 us an iteration and 50 bytes.
Rates round_rates() {
  Rates out;
  out.voxel_iteration_s = 1e-6;
  out.voxel_bytes = 50;
  return out;
}
Campaign cube(int side, double sets) {
  Campaign out;
  out.sets = sets;
  out.grid = centred_grid(side, side, side, 1);
  out.iterations = 10;
  return out;
}
Cluster lab() {
  return {
      .nodes = 2, .cores = 4, .memory_mib = 1024, .network_bytes_per_s = 1e9, .threads = 1, .efficiency = 1};
}

TEST(PlanSets, TimeIsWorkOverWorkers) {
  const Estimate e = plan_sets(cube(100, 800), lab(), round_rates(), 0.001);
  EXPECT_EQ(e.workers, 8);
  EXPECT_DOUBLE_EQ(e.set_s, 10);         // 1e6 voxels, 10 iterations, 1 us
  EXPECT_DOUBLE_EQ(e.wall_s, 100 * 10);  // 100 sets a worker
  EXPECT_EQ(e.bottleneck, "computing");
  EXPECT_TRUE(e.problems.empty());
}

TEST(PlanSets, TwiceTheNodesTakeHalfTheTimeUntilTheNetworkIsTheBottleneck) {
  Cluster cluster = lab();
  double before = plan_sets(cube(100, 1e6), cluster, round_rates(), 0).wall_s;
  for (;;) {
    cluster.nodes *= 2;
    const Estimate e = plan_sets(cube(100, 1e6), cluster, round_rates(), 0);
    if (e.bottleneck != "computing") {
      EXPECT_EQ(e.bottleneck, "network of the dispatcher");
      EXPECT_GT(e.wall_s, 0.5 * before * 0.99);
      break;
    }
    EXPECT_NEAR(e.wall_s, before / 2, 0.01 * before);
    before = e.wall_s;
    ASSERT_LT(cluster.nodes, 1 << 20);
  }
}

TEST(PlanSets, SaysWhatDoesNotFit) {
  Cluster cluster = lab();
  cluster.memory_mib = 160;  // of 48 and 9.8 MB of frames a worker: cores for 4
  const Estimate few = plan_sets(cube(100, 100), cluster, round_rates(), 0);
  EXPECT_LT(few.per_node, 4);
  ASSERT_EQ(few.problems.size(), 1u);
  EXPECT_NE(few.problems[0].find("memory is enough for"), std::string::npos) << few.problems[0];
  cluster.memory_mib = 20;
  const Estimate none = plan_sets(cube(100, 100), cluster, round_rates(), 0);
  EXPECT_NE(none.problems.at(0).find("a node has 20 MiB"), std::string::npos) << none.problems[0];
  EXPECT_NE(plan_sets(cube(100, 3), lab(), round_rates(), 0).problems.at(0).find("5 stay idle"),
            std::string::npos);
}

TEST(PlanRanks, ShareTimeAndMemory) {
  Cluster cluster = lab();
  cluster.threads = 4;
  cluster.nodes = 1;
  const Estimate one = plan_ranks(cube(256, 1), cluster, round_rates());
  cluster.nodes = 16;
  const Estimate many = plan_ranks(cube(256, 1), cluster, round_rates());
  EXPECT_EQ(many.workers, 16);
  EXPECT_NEAR(many.iteration_s - many.exchange_s, one.iteration_s / 16, 1e-9);
  EXPECT_LT(many.set_mib, one.set_mib / 4);
  EXPECT_DOUBLE_EQ(one.exchange_bytes, 0);
  EXPECT_GT(many.exchange_s, 0);
}

TEST(PlanRanks, UsesNoMoreRanksThanThereAreSlabs) {
  Cluster cluster = lab();
  cluster.nodes = 100;
  const Estimate e = plan_ranks(cube(256, 1), cluster, round_rates());
  EXPECT_EQ(e.workers, 16);
  EXPECT_NE(e.problems.at(0).find("would be refused"), std::string::npos) << e.problems[0];
}

TEST(PlanRanks, NamesTheNetworkWhereItIsSlow) {
  Cluster cluster = lab();
  cluster.nodes = 16;
  cluster.threads = 4;
  cluster.network_bytes_per_s = 1e6;
  EXPECT_EQ(plan_ranks(cube(256, 1), cluster, round_rates()).bottleneck, "exchange over the network");
}

// A third size, between the two that are tried or beyond them, is foretold.
TEST(Rates, ForetellAnotherSize) {
  const Recipe recipe{"sirt", {}};
  const auto rates = measure_rates(recipe, 8, {}, [](const std::string&) {});
  ASSERT_TRUE(rates) << rates.error().message;
  EXPECT_GT(rates->voxel_iteration_s, 1e-10);
  EXPECT_LT(rates->voxel_iteration_s, 1e-5);
  EXPECT_GT(rates->voxel_bytes, 4 * 4);  // at least field, sums, back-projection and support
  EXPECT_LT(rates->voxel_bytes, 100);
}

TEST(Rates, KnowWhoseTimeNobodyKnows) {
  EXPECT_EQ(iterations_of({"sirt", {{"sirt.max_iterations", std::int64_t{7}}}}), 7);
  EXPECT_GT(iterations_of({"hessian", {}}).value_or(0), 10);
  EXPECT_FALSE(iterations_of({"ert", {}}));
  const auto rates = measure_rates({"ert", {}}, 8, {}, [](const std::string&) {});
  ASSERT_FALSE(rates);
  EXPECT_NE(rates.error().message.find("no estimate for solver ert"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
