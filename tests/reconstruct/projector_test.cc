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
  const Layout& layout = projector.layout();

  std::vector<float> random_volume(std::uint64_t seed) const {
    return layout.pack_volume(random_values(grid.voxels(), seed));
  }
  std::vector<float> random_images(std::uint64_t seed) const {
    return layout.pack_images(random_values(plain_pixels(), seed));
  }
  std::size_t plain_pixels() const { return projector.views() * std::size_t(layout.rows * layout.cols); }
};

TEST_P(ProjectorTest, AdjointIsTheTransposeOfForward) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    SCOPED_TRACE(seed);
    const auto x = random_volume(seed), y = random_images(seed + 100);
    std::vector<float> ax(layout.pixels()), aty(layout.voxels());
    projector.forward(team, x, ax);
    projector.adjoint(team, y, aty);
    const double left = dot(ax, y), right = dot(x, aty);
    EXPECT_GT(left, 0);
    EXPECT_LE(std::abs(left - right), 1e-5 * std::abs(left));
  }
}

TEST_P(ProjectorTest, AColumnIsTheImageOfItsVoxel) {
  std::vector<ColumnEntry> column;
  std::vector<float> x(grid.voxels()), packed(layout.pixels());
  for (std::size_t voxel = 0; voxel < grid.voxels(); voxel += 41) {
    x.assign(grid.voxels(), 0);
    x[voxel] = 1;
    projector.forward(team, layout.pack_volume(x), packed);
    auto ax = layout.unpack_images(packed);
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
  std::vector<float> packed(layout.pixels());
  projector.forward(team, layout.pack_volume(volume.values), packed);
  const auto ax = layout.unpack_images(packed);
  for (std::size_t i = 0; i < ax.size(); ++i) EXPECT_NEAR(ax[i], rendered->values[i], 1e-4);
}

TEST_P(ProjectorTest, SubsetsOfViewsAddUpToTheWhole) {
  const auto y = random_images(8);
  std::vector<float> whole(layout.voxels()), part(layout.voxels()), sum(layout.voxels(), 0);
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
  const auto x = random_volume(1), y = random_images(2);
  std::vector<float> a(layout.pixels()), b(a), c(layout.voxels()), d(c);
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
