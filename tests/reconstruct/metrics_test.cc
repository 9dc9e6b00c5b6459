#include "reconstruct/metrics.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
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

using Values = std::vector<double>;

// The measures written down as their definitions say, in two passes.
double mean_of(const Values& v) {
  return std::accumulate(v.begin(), v.end(), 0.0) / static_cast<double>(v.size());
}
double covariance_sum(const Values& a, const Values& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - mean_of(a)) * (b[i] - mean_of(b));
  return sum;
}
double pearson_of(const Values& a, const Values& b) {
  return covariance_sum(a, b) / std::sqrt(covariance_sum(a, a) * covariance_sum(b, b));
}
double sqmd_of(const Values& truth, const Values& other) {
  double distance = 0, size = 0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    distance += std::abs(other[i] - truth[i]);
    size += std::abs(truth[i]);
  }
  return distance * distance / (size * size);
}

// The voxels for which `is_in` holds.
template <class IsIn>
Values chosen(const Volume& v, const IsIn& is_in) {
  Values out;
  for (int z = 0; z < v.grid.nz; ++z)
    for (int y = 0; y < v.grid.ny; ++y)
      for (int x = 0; x < v.grid.nx; ++x)
        if (is_in(x, y, z)) out.push_back(v.at(x, y, z));
  return out;
}

double ssim_of(const Volume& truth, const Volume& other) {
  const auto everywhere = [](int, int, int) { return true; };
  const Values all = chosen(truth, everywhere);
  const double peak = *std::max_element(all.begin(), all.end());
  const double c1 = std::pow(0.01 * peak, 2), c2 = std::pow(0.03 * peak, 2);
  Values windows;
  for (int y0 = 0; y0 < truth.grid.ny; ++y0)
    for (int z0 = 0; z0 + 7 <= truth.grid.nz; ++z0)
      for (int x0 = 0; x0 + 7 <= truth.grid.nx; ++x0) {
        const auto window = [&](int x, int y, int z) {
          return y == y0 && x >= x0 && x < x0 + 7 && z >= z0 && z < z0 + 7;
        };
        const Values a = chosen(truth, window), b = chosen(other, window);
        const double ma = mean_of(a), mb = mean_of(b);
        windows.push_back(
            (2 * ma * mb + c1) * (2 * covariance_sum(a, b) / 48 + c2) /
            ((ma * ma + mb * mb + c1) * (covariance_sum(a, a) / 48 + covariance_sum(b, b) / 48 + c2)));
      }
  return mean_of(windows);
}

TEST(Metrics, AgreeWithTheirDefinitionsWorkedOutVoxelByVoxel) {
  const Grid grid = centred_grid(9, 5, 8, 1);
  Volume truth = volume_of(grid, random_values(grid.voxels(), 21)), other = truth;
  const auto error = random_values(grid.voxels(), 22);
  for (std::size_t i = 0; i < error.size(); ++i) other.values[i] += 0.7f * error[i] - 0.2f;
  const auto m = compare(truth, other);
  ASSERT_TRUE(m.has_value());
  const auto everywhere = [](int, int, int) { return true; };
  const Values p = chosen(truth, everywhere), r = chosen(other, everywhere);
  EXPECT_NEAR(m->pearson, pearson_of(p, r), 1e-12);
  EXPECT_NEAR(m->sqmd, sqmd_of(p, r), 1e-12);
  double squares = 0;
  for (std::size_t i = 0; i < p.size(); ++i) squares += std::pow(p[i] - r[i], 2);
  const double rmse = std::sqrt(squares / static_cast<double>(p.size()));
  EXPECT_NEAR(m->rmse, rmse, 1e-12);
  EXPECT_NEAR(m->psnr_db, 20 * std::log10(*std::max_element(p.begin(), p.end()) / rmse), 1e-9);
  EXPECT_NEAR(m->ssim, ssim_of(truth, other), 1e-9);
  const std::array<int, 3> sizes = {9, 5, 8};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    ASSERT_EQ(m->slices[axis].size(), static_cast<std::size_t>(sizes[axis]));
    for (const SliceMetrics& s : m->slices[axis]) {
      const auto slice = [&](int x, int y, int z) { return std::array{x, y, z}[axis] == s.index; };
      EXPECT_NEAR(s.pearson, pearson_of(chosen(truth, slice), chosen(other, slice)), 1e-9);
      EXPECT_NEAR(s.sqmd, sqmd_of(chosen(truth, slice), chosen(other, slice)), 1e-12);
    }
  }
}

TEST(Metrics, ScaleAndOffsetLeaveTheCorrelationAndScaleTheError) {
  const Grid grid = centred_grid(7, 7, 7, 1);
  const Volume truth = volume_of(grid, random_values(grid.voxels(), 23));
  Volume other = truth;
  for (float& v : other.values) v = 3 * v + 2;
  const auto m = compare(truth, other);
  ASSERT_TRUE(m.has_value());
  EXPECT_NEAR(m->pearson, 1, 1e-9);
  Volume twice = truth, twice_other = other;
  for (float& v : twice.values) v *= 2;
  for (float& v : twice_other.values) v *= 2;
  const auto n = compare(twice, twice_other);
  EXPECT_NEAR(n->rmse, 2 * m->rmse, 1e-6);
  EXPECT_NEAR(n->sqmd, m->sqmd, 1e-6);
  EXPECT_NEAR(n->psnr_db, m->psnr_db, 1e-5);
  EXPECT_NEAR(n->ssim, m->ssim, 1e-6);
}

TEST(Metrics, ADarkTruthHasNoPeakToMeasureBy) {
  const Grid grid = centred_grid(8, 8, 8, 1);
  const auto m = compare(Volume(grid), Volume(grid, 1));
  ASSERT_TRUE(m.has_value());
  EXPECT_TRUE(std::isnan(m->sqmd));
  EXPECT_TRUE(std::isnan(m->psnr_db));
  EXPECT_TRUE(std::isnan(m->ssim));
  EXPECT_EQ(m->rmse, 1);
}

TEST(Metrics, AVoxelThatIsNoNumberIsNamed) {
  const Grid grid = centred_grid(4, 5, 6, 1);
  Volume bad(grid, 1);
  bad.at(1, 2, 3) = NAN;
  const auto m = compare(Volume(grid, 1), bad);
  ASSERT_FALSE(m.has_value());
  EXPECT_NE(m.error().message.find("x=1, y=2, z=3"), std::string::npos) << m.error().message;
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

TEST(Metrics, ADarkViewIsLeftOutOfTheMeanDistance) {
  Projections a{{"a", "b"}, 1, 2, {3, 4, 0, 0}}, b{{"a", "b"}, 1, 2, {3, 9, 1, 0}};
  EXPECT_NEAR(mean_sqmd(a, b), 25.0 / 49, 1e-12);
  EXPECT_EQ(residual_per_view(a, b)[1], INFINITY);
  EXPECT_EQ(residual_per_view(a, a)[1], 0);
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
