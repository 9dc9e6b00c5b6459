#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "reconstruct/constraints.h"
#include "reconstruct/noise_model.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/sweeps.h"
#include "reconstruct/vectors.h"
#include "tests/reconstruct/tiny_problem.h"

namespace flamefield {
namespace {

TEST(Vectors, SumsAreTheSameBitsForAnyNumberOfThreads) {
  const auto a = random_values(100003, 1), b = random_values(100003, 2);
  Team one(1), seven(7);
  const double sum = flamefield::dot(one, a, b);
  EXPECT_EQ(sum, flamefield::dot(seven, a, b));
  double plain = 0;
  for (std::size_t i = 0; i < a.size(); ++i) plain += static_cast<double>(a[i]) * b[i];
  EXPECT_NEAR(sum, plain, 1e-6 * plain);
}

TEST(Subsets, DealEveryViewOnce) {
  for (const int wanted : {1, 2, 5, 15, 40}) {
    std::vector<std::size_t> all;
    for (const auto& subset : ordered_subsets(15, wanted))
      all.insert(all.end(), subset.begin(), subset.end());
    std::ranges::sort(all);
    EXPECT_EQ(all.size(), 15u);
    for (std::size_t v = 0; v < all.size(); ++v) EXPECT_EQ(all[v], v);
  }
}

TEST(VisualHull, HoldsTheBodyAndLittleElse) {
  const Grid grid = centred_grid(24, 24, 24, 1.5);
  const Volume truth = make_phantom({.kind = PhantomKind::Torus}, grid);
  const Rig rig = level_ring(grid, 8);
  Team team(2);
  const auto projector = *Projector::make(rig, grid, {}, team);
  auto images = projector.layout().pack_images(render(truth, rig, {.pixel_samples = 2})->values);
  const float brightest = *std::ranges::max_element(images);
  for (float& v : images) v /= brightest;
  const auto hull = visual_hull(projector, images, 0.02, team);
  const auto body = projector.layout().pack_volume(truth.values);
  const float most = *std::ranges::max_element(body);
  std::size_t in_hull = 0, in_body = 0;
  for (std::size_t j = 0; j < hull.size(); ++j) {
    in_hull += hull[j];
    in_body += body[j] > 0.05f * most;
    if (body[j] > 0.2f * most) {
      ASSERT_EQ(hull[j], 1) << j;
    }
  }
  EXPECT_LT(in_hull, 3 * in_body);
  EXPECT_GE(in_hull, in_body);
}

TEST(VisualHull, AVoxelThatACameraDoesNotSeeIsJudgedByTheOthers) {
  TinyProblem tiny;
  for (Camera& camera : tiny.rig.cameras) camera.fx_px *= 3;  // only the middle fills the views
  const auto projector = *Projector::make(tiny.rig, tiny.grid, {}, tiny.team);
  const std::vector<float> bright(projector.layout().pixels(), 1);
  const auto hull = visual_hull(projector, bright, 0.5, tiny.team);
  EXPECT_EQ(std::ranges::count(hull, 1), static_cast<std::ptrdiff_t>(tiny.grid.voxels()));
}

// Flame-like images with Gaussian noise of known size.
TEST(NoiseModel, EstimatesReadNoiseWithinAFifth) {
  const Grid grid = centred_grid(40, 40, 40, 1);
  const Rig rig = level_ring(grid, 6);
  Projections images = *render(make_phantom({.kind = PhantomKind::Gaussian}, grid), rig, {});
  const float brightest = *std::ranges::max_element(images.values);
  const Layout layout(grid, 6, images.rows, images.cols);
  for (const double sigma : {0.005, 0.02, 0.1}) {
    Stream stream(3, 0);
    Projections noisy = images;
    for (float& v : noisy.values) v = v / brightest + static_cast<float>(sigma * stream.normal());
    const auto packed = layout.pack_images(noisy.values);
    const NoiseModel noise = estimate_noise(packed, layout);
    EXPECT_NEAR(std::sqrt(noise.variance(0.5)) / sigma, 1, 0.2) << sigma;
    const auto clean = layout.pack_images(images.values);
    EXPECT_GT(expected_residual(noise, packed, layout), 0) << sigma;
  }
}

TEST(NoiseModel, TellsShotNoiseFromReadNoise) {
  const Grid grid = centred_grid(40, 40, 40, 1);
  const Rig rig = level_ring(grid, 6);
  Projections images = *render(make_phantom({.kind = PhantomKind::Gaussian}, grid), rig, {});
  ASSERT_TRUE(add_noise(images, {.photons = 1000, .read_noise = 3}));
  const float brightest = *std::ranges::max_element(images.values);
  for (float& v : images.values) v /= brightest;
  const Layout layout(grid, 6, images.rows, images.cols);
  const NoiseModel noise = estimate_noise(layout.pack_images(images.values), layout);
  for (const double value : {0.0, 0.3, 0.8}) {
    const double expected = std::sqrt(3.0 * 3.0 + 1000 * value) / 1000;
    EXPECT_NEAR(std::sqrt(noise.variance(value)) / expected, 1, 0.3) << value;
  }
}

class MonitorRules : public testing::Test {
 protected:
  // The reason and iteration at which residuals 1, 1/2, 1/3, ... end.
  std::pair<StopReason, int> end(const StopRules& rules, int max_iterations = 1000) const {
    const SolveControl control;
    Monitor monitor(control, max_iterations, rules);
    for (int i = 1;; ++i)
      if (const auto reason = monitor.after(i, 1.0 / i)) return {*reason, i};
  }
};

TEST_F(MonitorRules, EachEndsTheSolveWhereItsFormulaSays) {
  using Pair = std::pair<StopReason, int>;
  EXPECT_EQ(end({}, 50), Pair(StopReason::Iterations, 50));
  EXPECT_EQ(end({.residual = 0.1}), Pair(StopReason::Residual, 10));
  EXPECT_EQ(end({.discrepancy = 2, .expected_residual = 0.025}), Pair(StopReason::Discrepancy, 20));
  // From i to i + 10 it falls by 10 / (i + 10): below 0.2 at i + 10 > 50.
  EXPECT_EQ(end({.stagnation = 0.2}), Pair(StopReason::Stagnation, 51));
}

TEST(Choice, IsReadByNameAndDocumentedWithItsNames) {
  Recipe recipe;
  ASSERT_TRUE(assign(recipe, "tikhonov.weight_rule=l-curve"));
  EXPECT_TRUE(validate_recipe(recipe));
  recipe.settings["tikhonov.weight_rule"] = std::string("lcurve");
  const auto refused = validate_recipe(recipe);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("fixed | discrepancy | held-out | l-curve"), std::string::npos)
      << refused.error().message;
  for (const SettingDoc& doc : settings_of("tikhonov"))
    if (doc.key == "weight_rule") {
      EXPECT_EQ(doc.default_value, "discrepancy");
    }
}

}  // namespace
}  // namespace flamefield
