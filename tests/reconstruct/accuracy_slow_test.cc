#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/random.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"
#include "reconstruct/solver.h"

namespace flamefield {
namespace {

// The stratified flame seen by 15 cameras. The truth is three times finer than the reconstruction and the
// images have more rays and finer steps than the solvers, so that no result rests on an inverse crime.
class Stratified : public testing::Test {
 protected:
  Grid grid = centred_grid(52, 55, 52, 1.32);
  Rig rig = *make_ring({}, grid);
  Volume truth;
  Projections clean;
  Team team{2};
  Projector projector = *Projector::make(rig, grid, {}, team);

  Stratified() {
    const Grid fine = centred_grid(3 * 52, 3 * 55, 3 * 52, 0.44);
    const Volume field = make_phantom({.kind = PhantomKind::Stratified}, fine);
    truth = resample(field, grid);
    clean = *render(field, rig, {.step_voxels = 0.5, .pixel_samples = 3});
  }
  // sigma: share of the brightest pixel
  Projections noisy(double sigma, std::uint64_t seed) const {
    Projections out = clean;
    const double brightest = *std::ranges::max_element(clean.values);
    for (std::size_t i = 0; i < out.values.size(); ++i)
      out.values[i] += static_cast<float>(sigma * brightest * Stream(seed, i).normal());
    return out;
  }
};

struct Reach {
  const char* solver;
  double pearson, sqmd;              // at 2 % noise
  double clean_pearson, clean_sqmd;  // without noise
};

TEST_F(Stratified, DefaultsOfTheClassicalSolversComeNearTheirBest) {
  const Projections with_noise = noisy(0.02, 7);
  std::printf("%-10s %8s %8s | %8s %8s   (2 %% noise | none)\n", "solver", "Pearson", "SqMD", "Pearson",
              "SqMD");
  for (const Reach& r : {Reach{"sirt", .983, .040, .991, .020}, Reach{"sart", .981, .052, .988, .030},
                         Reach{"os-sart", .983, .042, .991, .020}, Reach{"art", .974, .050, .990, .022},
                         Reach{"mart", .974, .055, .989, .022}, Reach{"mlem", .978, .058, .988, .026},
                         Reach{"osem", .975, .060, .989, .024}, Reach{"cgls", .969, .10, .987, .032},
                         Reach{"tikhonov", .985, .038, .992, .018}, Reach{"map", .985, .038, .990, .025},
                         Reach{"fdk", .91, .45, .91, .45}}) {
    Recipe recipe{r.solver, {}};
    recipe.settings["map.draws"] = std::int64_t{0};
    const auto a = reconstruct(with_noise, projector, recipe, {}),
               b = reconstruct(clean, projector, recipe, {});
    ASSERT_TRUE(a && b) << r.solver;
    const FieldMetrics m = *compare(truth, a->volume), n = *compare(truth, b->volume);
    std::printf("%-10s %8.4f %8.4f | %8.4f %8.4f\n", r.solver, m.pearson, m.sqmd, n.pearson, n.sqmd);
    EXPECT_GT(m.pearson, r.pearson) << r.solver;
    EXPECT_LT(m.sqmd, r.sqmd) << r.solver;
    EXPECT_GT(n.pearson, r.clean_pearson) << r.solver;
    EXPECT_LT(n.sqmd, r.clean_sqmd) << r.solver;
  }
}

// What `map` says about its own noise against what 50 repetitions of the experiment show.
TEST_F(Stratified, TheSigmaOfMapIsTheScatterOver50DrawsOfTheNoise) {
  const auto predicted = reconstruct(noisy(0.02, 1000), projector, {"map", {}}, {});
  ASSERT_TRUE(predicted);
  ASSERT_EQ(predicted->sigma.size(), grid.voxels());
  constexpr int kDraws = 50;
  std::vector<double> sum(grid.voxels(), 0), squares(grid.voxels(), 0);
  const Recipe recipe{"map", {{"map.draws", std::int64_t{0}}}};
  for (std::uint64_t seed = 1; seed <= kDraws; ++seed) {
    const auto drawn = reconstruct(noisy(0.02, seed), projector, recipe, {});
    ASSERT_TRUE(drawn);
    for (std::size_t j = 0; j < sum.size(); ++j) {
      const double v = drawn->volume.values[j];
      sum[j] += v;
      squares[j] += v * v;
    }
  }
  const float lit = 0.05f * *std::ranges::max_element(truth.values);
  std::vector<double> ratios, deviations;
  for (std::size_t j = 0; j < sum.size(); ++j) {
    if (truth.values[j] < lit) continue;
    const double variance = (squares[j] - sum[j] * sum[j] / kDraws) / (kDraws - 1);
    if (!(variance > 0)) continue;
    ratios.push_back(static_cast<double>(predicted->sigma[j]) / std::sqrt(variance));
    deviations.push_back(std::abs(ratios.back() - 1));
  }
  const auto median = [](std::vector<double>& v) {
    std::ranges::nth_element(v, v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2));
    return v[v.size() / 2];
  };
  const double ratio = median(ratios), deviation = median(deviations);
  std::printf("predicted / observed sigma at %zu lit voxels: median %.3f, median |deviation| %.3f\n",
              ratios.size(), ratio, deviation);
  EXPECT_NEAR(ratio, 1, 0.2);
  EXPECT_LT(deviation, 0.2);
}

}  // namespace
}  // namespace flamefield
