#include "reconstruct/metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "reconstruct/phantom/phantom.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

Volume volume_of(const Grid& grid, std::vector<float> values) {
  Volume out(grid);
  out.values = std::move(values);
  return out;
}

TEST(Metrics, AgreeWithNumbersWorkedOutByHand) {
  const Grid grid = centred_grid(2, 2, 1, 1);
  const Volume truth = volume_of(grid, {1, 2, 3, 4}), other = volume_of(grid, {1, 3, 2, 5});
  const auto m = compare(truth, other);
  ASSERT_TRUE(m.has_value());
  // Deviations (-1.5, -.5, .5, 1.5) and (-1.75, .25, -.75, 2.25): 5.5 / sqrt(5 * 8.75).
  EXPECT_NEAR(m->pearson, 5.5 / std::sqrt(43.75), 1e-12);
  EXPECT_NEAR(m->sqmd, 0.09, 1e-12);  // (3 / 10)^2
  EXPECT_NEAR(m->rmse, std::sqrt(0.75), 1e-12);
  EXPECT_NEAR(m->psnr_db, 20 * std::log10(4 / std::sqrt(0.75)), 1e-12);
  ASSERT_EQ(m->slices[1].size(), 2u);
  EXPECT_NEAR(m->slices[1][0].pearson, 1, 1e-12);
  EXPECT_NEAR(m->slices[1][1].sqmd, 4.0 / 49, 1e-12);
  EXPECT_TRUE(std::isnan(m->slices[2][0].pearson) == false);
}

TEST(Metrics, AConstantSliceHasNoCorrelationAndADarkOneNoDistance) {
  const Grid grid = centred_grid(2, 2, 2, 1);
  const auto m = compare(volume_of(grid, {0, 0, 0, 0, 1, 2, 3, 4}), Volume(grid, 0.3f));
  ASSERT_TRUE(m.has_value());
  EXPECT_TRUE(std::isnan(m->pearson));
  EXPECT_TRUE(std::isnan(m->slices[2][0].sqmd));
}

TEST(Metrics, AFieldIsIdenticalToItself) {
  const Volume v = make_phantom({.kind = PhantomKind::Torus}, centred_grid(16, 16, 16, 1));
  const auto m = compare(v, v);
  ASSERT_TRUE(m.has_value());
  EXPECT_NEAR(m->pearson, 1, 1e-9);
  EXPECT_EQ(m->sqmd, 0);
  EXPECT_NEAR(m->ssim, 1, 1e-9);
}

TEST(Metrics, DifferentGridsAreRefused) {
  EXPECT_FALSE(compare(Volume(centred_grid(4, 4, 4, 1)), Volume(centred_grid(4, 4, 5, 1))).has_value());
  EXPECT_FALSE(compare(Volume(centred_grid(4, 4, 4, 1)), Volume(centred_grid(4, 4, 4, 1.1))).has_value());
}

TEST(Metrics, ResidualsAreRelativeToEachView) {
  Projections a{{"a", "b"}, 1, 2, {3, 4, 0, 2}}, b{{"a", "b"}, 1, 2, {3, 9, 0, 2}};
  EXPECT_EQ(residual_per_view(a, b), (std::vector<double>{1, 0}));
  EXPECT_NEAR(mean_sqmd(a, b), 0.5 * 25.0 / 49, 1e-12);
}

double integral(const Volume& v) {
  return std::accumulate(v.values.begin(), v.values.end(), 0.0) * v.grid.spacing_mm.prod();
}

TEST(Resample, ConservesTheIntegralOnAnyGridOverTheWholeBox) {
  Volume fine(centred_grid(15, 18, 21, 0.5));
  fine.values = random_values(fine.grid.voxels(), 11);
  for (const Grid& grid :
       {centred_grid(5, 6, 7, 1.5), centred_grid(13, 11, 12, 1.1), centred_grid(40, 50, 60, 0.3)}) {
    EXPECT_NEAR(integral(resample(fine, grid)), integral(fine), 1e-5 * integral(fine));
  }
}

TEST(Resample, AveragesTheTrilinearFieldOverEachCell) {
  Volume fine(centred_grid(6, 5, 4, 1));
  fine.values = random_values(fine.grid.voxels(), 12);
  const Grid grid = centred_grid(3, 3, 2, 1.7);
  const Volume coarse = resample(fine, grid);
  constexpr int kSamples = 40;
  for (int z = 0; z < grid.nz; ++z)
    for (int x = 0; x < grid.nx; ++x) {
      double sum = 0;
      for (int s = 0; s < kSamples * kSamples * kSamples; ++s) {
        const Eigen::Vector3d f(s % kSamples, s / kSamples % kSamples, s / kSamples / kSamples);
        const Eigen::Vector3d off = ((f.array() + 0.5) / kSamples - 0.5).matrix();
        sum += sample(fine, grid.voxel_centre_mm(x, 1, z) + grid.spacing_mm.cwiseProduct(off));
      }
      EXPECT_NEAR(coarse.at(x, 1, z), sum / (kSamples * kSamples * kSamples), 1e-3);
    }
}

}  // namespace
}  // namespace flamefield
