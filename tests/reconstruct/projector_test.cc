#include "reconstruct/projector.h"

#include <gtest/gtest.h>

#include <cmath>

#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

struct Case {
  std::string name;
  bool crooked;
  double budget_mib;  // 0: traced
  int pixel_samples;
};

class ProjectorTest : public testing::TestWithParam<Case> {
 protected:
  Grid grid = [] {
    Grid g = centred_grid(14, 17, 12, 1.3);
    g.spacing_mm = {1.3, 1.1, 1.5};
    return g;
  }();
  Rig rig = GetParam().crooked ? crooked_ring(grid, 4) : level_ring(grid, 4);
  Team team{2};
  Projector projector = *Projector::make(
      rig, grid, {.pixel_samples = GetParam().pixel_samples, .memory_budget_mib = GetParam().budget_mib},
      team);
};

TEST_P(ProjectorTest, AdjointIsTheTransposeOfForward) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const auto x = random_values(grid.voxels(), seed), y = random_values(projector.pixels(), seed + 100);
    std::vector<float> ax(projector.pixels()), aty(grid.voxels());
    projector.forward(team, x, ax);
    projector.adjoint(team, y, aty);
    const double left = dot(ax, y), right = dot(x, aty);
    EXPECT_GT(left, 0);
    EXPECT_LE(std::abs(left - right), 1e-5 * std::abs(left));
  }
}

TEST_P(ProjectorTest, AColumnIsTheImageOfItsVoxel) {
  std::vector<ColumnEntry> column;
  std::vector<float> x(grid.voxels()), ax(projector.pixels());
  for (std::size_t voxel = 0; voxel < grid.voxels(); voxel += 41) {
    x.assign(grid.voxels(), 0);
    x[voxel] = 1;
    projector.forward(team, x, ax);
    projector.column(voxel, column);
    for (const ColumnEntry& e : column) {
      EXPECT_NEAR(ax[e.pixel], e.weight, 1e-5);
      ax[e.pixel] = 0;
    }
    for (float rest : ax) EXPECT_NEAR(rest, 0, 1e-6);
  }
}

TEST_P(ProjectorTest, ForwardAgreesWithTheRenderer) {
  Volume volume(grid);
  volume.values = random_values(grid.voxels(), 3);
  const auto rendered = render(volume, rig, {.pixel_samples = GetParam().pixel_samples});
  ASSERT_TRUE(rendered.has_value());
  std::vector<float> ax(projector.pixels());
  projector.forward(team, volume.values, ax);
  for (std::size_t i = 0; i < ax.size(); ++i) EXPECT_NEAR(ax[i], rendered->values[i], 1e-4);
}

TEST_P(ProjectorTest, SubsetsOfViewsAddUpToTheWhole) {
  const auto y = random_values(projector.pixels(), 8);
  std::vector<float> whole(grid.voxels()), part(grid.voxels()), sum(grid.voxels(), 0);
  projector.adjoint(team, y, whole);
  for (const std::vector<std::size_t>& views :
       {std::vector<std::size_t>{0, 2}, std::vector<std::size_t>{1, 3}}) {
    projector.adjoint(team, views, y, part);
    for (std::size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
  }
  for (std::size_t i = 0; i < sum.size(); ++i) EXPECT_NEAR(sum[i], whole[i], 1e-3);
}

TEST_P(ProjectorTest, ResultsAreBitIdenticalForAnyNumberOfThreads) {
  Team one(1), three(3);
  const auto x = random_values(grid.voxels(), 1), y = random_values(projector.pixels(), 2);
  std::vector<float> a(projector.pixels()), b(a), c(grid.voxels()), d(c);
  projector.forward(one, x, a);
  projector.forward(three, x, b);
  projector.adjoint(one, y, c);
  projector.adjoint(three, y, d);
  EXPECT_EQ(a, b);
  EXPECT_EQ(c, d);
}

INSTANTIATE_TEST_SUITE_P(Engines, ProjectorTest,
                         testing::Values(Case{"LevelStored", false, 1000, 1},
                                         Case{"LevelStoredSubPixels", false, 1000, 2},
                                         Case{"CrookedStored", true, 1000, 2},
                                         Case{"LevelTraced", false, 0, 1}, Case{"CrookedTraced", true, 0, 2}),
                         [](const auto& tested) { return tested.param.name; });

TEST(Projector, FallsBackToTracingWhenTheMatrixIsOverBudget) {
  const Grid grid = centred_grid(16, 16, 16, 1);
  Team team(1);
  EXPECT_EQ(Projector::make(level_ring(grid, 3), grid, {.memory_budget_mib = 0.1}, team)->engine(), "traced");
  EXPECT_EQ(Projector::make(level_ring(grid, 3), grid, {}, team)->engine().substr(0, 6), "stored");
}

TEST(Projector, CamerasOfDifferentSizesAreRefused) {
  const Grid grid = centred_grid(8, 8, 8, 1);
  Rig rig = level_ring(grid, 2);
  rig.cameras[1].image_height_px = 9;
  Team team(1);
  EXPECT_FALSE(Projector::make(rig, grid, {}, team).has_value());
}

}  // namespace
}  // namespace flamefield
