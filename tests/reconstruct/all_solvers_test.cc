#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "reconstruct/constraints.h"
#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/registry.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// A torus seen by 8 cameras over half a turn, so that every solver of the registry can take it.
struct Scene {
  Grid grid = centred_grid(14, 12, 14, 2.5);
  Rig rig = level_ring(grid, 8);
  Volume truth = make_phantom({.kind = PhantomKind::Torus}, grid);
  Projections images = *render(truth, rig, {.step_voxels = 0.25, .pixel_samples = 2});
  float brightest = *std::ranges::max_element(images.values);
};
const Scene& scene() {
  static const Scene one;
  return one;
}

// Short solves; keys that a solver does not have are left out.
Recipe short_recipe(std::string_view solver) {
  Recipe recipe{std::string(solver), {}};
  const auto limit = [&](std::string_view key, Setting value) {
    for (const SettingDoc& doc : settings_of(solver))
      if (doc.key == key) recipe.settings[concat(solver, ".", key)] = value;
  };
  limit("max_iterations", std::int64_t{15});
  limit("max_generations", std::int64_t{300});
  limit("draws", std::int64_t{3});
  limit("weight_rule", std::string("fixed"));
  return recipe;
}

Result<Reconstruction> run(const Scene& s, const Recipe& recipe, const SolveControl& control = {}) {
  return reconstruct(s.images, s.rig, s.grid, recipe, control);
}

void expect_sound(const Reconstruction& out, std::string_view what) {
  for (const float v : out.volume.values) {
    ASSERT_TRUE(std::isfinite(v)) << what;
    ASSERT_GE(v, 0) << what;
  }
  EXPECT_TRUE(std::isfinite(out.residual)) << what;
}

class EverySolver : public testing::TestWithParam<std::string_view> {
 protected:
  static bool takes_start() { return std::ranges::find(solvers(), GetParam(), &Solver::name)->takes_start; }
};

TEST_P(EverySolver, GivesTheSameBitsWith1And2And7Threads) {
  const Recipe recipe = short_recipe(GetParam());
  const auto one = run(scene(), recipe, {.threads = 1});
  ASSERT_TRUE(one) << one.error().message;
  expect_sound(*one, GetParam());
  for (const int threads : {2, 7}) {
    const auto many = run(scene(), recipe, {.threads = threads});
    ASSERT_TRUE(many);
    EXPECT_EQ(one->volume.values, many->volume.values) << threads;
    EXPECT_EQ(one->sigma, many->sigma) << threads;
    EXPECT_EQ(one->iterations, many->iterations) << threads;
  }
}

TEST_P(EverySolver, LeavesVoxelsOutsideTheVisualHullDark) {
  Recipe recipe = short_recipe(GetParam());
  recipe.settings["constraints.visual_hull"] = true;
  recipe.settings["constraints.hull_threshold"] = 0.05;
  const auto out = run(scene(), recipe);
  ASSERT_TRUE(out) << out.error().message;
  Team team(1);
  const auto projector = *Projector::make(scene().rig, scene().grid, {}, team);
  auto images = projector.layout().pack_images(scene().images.values);
  for (float& v : images) v /= scene().brightest;
  const auto hull = visual_hull(projector, images, 0.05, team);
  const auto field = projector.layout().pack_volume(out->volume.values);
  std::size_t outside = 0;
  for (std::size_t j = 0; j < hull.size(); ++j) {
    if (hull[j]) continue;
    ++outside;
    ASSERT_EQ(field[j], 0) << j;
  }
  EXPECT_GT(outside, hull.size() / 4);
  EXPECT_GT(compare(scene().truth, out->volume)->pearson, 0.5);
}

TEST_P(EverySolver, StaysAtASolutionThatItStartsFrom) {
  if (!takes_start()) {
    const auto out = run(scene(), short_recipe(GetParam()), {.start = &scene().truth});
    ASSERT_FALSE(out);
    EXPECT_NE(out.error().message.find("has no use for one"), std::string::npos) << out.error().message;
    return;
  }
  Recipe longer = short_recipe(GetParam());
  for (auto& [key, value] : longer.settings)
    if (key.ends_with("max_iterations")) value = std::int64_t{400};
  const auto solved = run(scene(), longer);
  ASSERT_TRUE(solved) << solved.error().message;
  Recipe shorter = short_recipe(GetParam());
  for (auto& [key, value] : shorter.settings)
    if (key.ends_with("max_iterations")) value = std::int64_t{3};
  const auto warm = run(scene(), shorter, {.start = &solved->volume}), cold = run(scene(), shorter);
  ASSERT_TRUE(warm && cold);
  if (solved->offspring > 0) {  // evolution goes on improving where it had found too little to gain
    EXPECT_LE(warm->residual, 1.01 * solved->residual);
    return;
  }
  const double moved = relative_distance(warm->volume.values, solved->volume.values);
  EXPECT_LT(moved, 0.1);  // primal-dual solvers find their dual variables anew
  // A regularised solver may arrive within three iterations from anywhere, as its search for a weight solves
  // too.
  EXPECT_LE(moved, 1.01 * relative_distance(cold->volume.values, solved->volume.values) + 1e-3);
}

TEST_P(EverySolver, TakesADomainOfOneVoxelAlongAnyAxis) {
  for (int axis = 0; axis < 3; ++axis) {
    Scene flat;
    flat.grid = centred_grid(axis == 0 ? 1 : 10, axis == 1 ? 1 : 10, axis == 2 ? 1 : 10, 2);
    flat.rig = *make_ring({.views = 8,
                           .spacing_rad = 0.39269908169872414,
                           .radius_mm = 120,
                           .image_width_px = 12,
                           .image_height_px = axis == 1 ? 1 : 12},
                          flat.grid);
    flat.truth = Volume(flat.grid, 1);
    flat.images = *render(flat.truth, flat.rig, {.pixel_samples = 2});
    const auto out = run(flat, short_recipe(GetParam()));
    ASSERT_TRUE(out) << axis << ": " << out.error().message;
    expect_sound(*out, concat(GetParam(), " axis ", axis));
  }
}

TEST_P(EverySolver, StandsABackgroundBelowZeroAndAFieldOfNoise) {
  Scene dim = scene();
  for (float& v : dim.images.values) v -= 0.05f * dim.brightest;
  const auto negative = run(dim, short_recipe(GetParam()));
  ASSERT_TRUE(negative) << negative.error().message;
  expect_sound(*negative, GetParam());
  EXPECT_GT(compare(scene().truth, negative->volume)->pearson, 0.4);
  for (float& v : dim.images.values) v = -1;
  const auto dark = run(dim, short_recipe(GetParam()));
  ASSERT_TRUE(dark) << dark.error().message;
  expect_sound(*dark, GetParam());
}

TEST_P(EverySolver, ReturnsTheBestSoFarWhenItIsCancelledInTheMiddle) {
  std::stop_source source;
  Recipe recipe = short_recipe(GetParam());
  for (auto& [key, value] : recipe.settings)
    if (key.ends_with("iterations") || key.ends_with("generations")) value = std::int64_t{1000000};
  SolveControl control{.stop = source.get_token()};
  control.progress = [&](const SolverProgress& p) {
    if (p.iteration >= 2) source.request_stop();
  };
  const auto out = run(scene(), recipe, control);
  ASSERT_TRUE(out) << out.error().message;
  expect_sound(*out, GetParam());
  if (GetParam() == "fdk") return;  // has nothing to be in the middle of
  // A solve that needs no more than a few iterations may be done by then.
  EXPECT_TRUE(out->stop_reason == StopReason::Cancelled || out->stop_reason == StopReason::Converged)
      << name_of(out->stop_reason);
  EXPECT_GT(compare(scene().truth, out->volume)->pearson, 0.3);
}

INSTANTIATE_TEST_SUITE_P(Registry, EverySolver, testing::ValuesIn(solver_names()), [](const auto& tested) {
  std::string name(tested.param);
  std::ranges::replace(name, '-', '_');
  return name;
});

TEST(BadInput, ACameraThatDoesNotSeeTheDomainIsNamed) {
  Scene s = scene();
  s.rig.cameras[5].camera_from_world.translation_mm.x() += 1000;
  const auto out = run(s, {"sirt", {}});
  ASSERT_FALSE(out);
  EXPECT_EQ(out.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(out.error().message.find("camera cam05 does not see the domain"), std::string::npos)
      << out.error().message;
}

TEST(BadInput, ViewsOfDifferentSizeAreRefused) {
  Scene s = scene();
  s.rig.cameras[2].image_width_px += 1;
  const auto out = run(s, {"sirt", {}});
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().message.find("cam02"), std::string::npos) << out.error().message;
}

TEST(BadInput, SaturatedImagesAreTakenWithANote) {
  Scene s = scene();
  EXPECT_TRUE(run(s, short_recipe("sirt"))->notes.empty());
  for (float& v : s.images.values) v = std::min(v, 0.6f * s.brightest);
  const auto out = run(s, short_recipe("sirt"));
  ASSERT_TRUE(out);
  ASSERT_EQ(out->notes.size(), 1u);
  EXPECT_NE(out->notes[0].find("saturated"), std::string::npos) << out->notes[0];
}

TEST(BadInput, AWarmStartOfAnotherGridIsRefused) {
  Volume start = scene().truth;
  start.grid.origin_mm.x() += 1;
  const auto out = run(scene(), {"sirt", {}}, {.start = &start});
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().message.find("warm start"), std::string::npos) << out.error().message;
  start = scene().truth;
  start.values[7] = NAN;
  EXPECT_FALSE(run(scene(), {"sirt", {}}, {.start = &start}));
}

TEST(BadInput, ARayTableBeyondItsBudgetIsRefused) {
  const auto out = run(scene(), {"art", {{"art.memory_budget_mib", 0.1}}});
  ASSERT_FALSE(out);
  EXPECT_NE(out.error().message.find("art.memory_budget_mib"), std::string::npos) << out.error().message;
}

TEST(StopRulesOfARecipe, EndARealSolve) {
  Scene noisy = scene();
  Stream stream(1, 0);
  for (float& v : noisy.images.values) v += static_cast<float>(0.05 * noisy.brightest * stream.normal());
  Recipe recipe{
      "sirt",
      {{"sirt.max_iterations", std::int64_t{2000}}, {"stop.discrepancy", 1.2}, {"noise.sigma", 0.05}}};
  const auto given = run(noisy, recipe);
  ASSERT_TRUE(given);
  EXPECT_EQ(given->stop_reason, StopReason::Discrepancy);
  recipe.settings.erase("noise.sigma");  // now it is estimated
  recipe.settings["stop.discrepancy"] = 1.5;
  EXPECT_EQ(run(noisy, recipe)->stop_reason, StopReason::Discrepancy);
  EXPECT_EQ(run(noisy, {"sirt", {{"sirt.max_iterations", std::int64_t{2000}}, {"stop.stagnation", 0.01}}})
                ->stop_reason,
            StopReason::Stagnation);
  EXPECT_EQ(run(noisy, {"sirt", {{"stop.residual", 0.5}}})->stop_reason, StopReason::Residual);
}

}  // namespace
}  // namespace flamefield
