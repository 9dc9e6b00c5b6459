#include "reconstruct/solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// A torus seen by 8 cameras, rendered with finer steps and more rays than the solvers use.
struct TorusScene {
  Grid grid = centred_grid(24, 24, 24, 1.5);
  Rig rig = level_ring(grid, 8);
  Volume truth = make_phantom({.kind = PhantomKind::Torus}, grid);
  Projections images = *render(truth, rig, {.step_voxels = 0.2, .pixel_samples = 3});
};
const TorusScene& torus() {
  static const TorusScene scene;
  return scene;
}

Recipe recipe_of(const std::string& solver, std::initializer_list<const char*> settings = {}) {
  Recipe recipe;
  recipe.solver = solver;
  for (const char* s : settings) EXPECT_TRUE(assign(recipe, s).has_value());
  return recipe;
}

Result<Reconstruction> run(const Recipe& recipe, const SolveControl& control = {}) {
  return reconstruct(torus().images, torus().rig, torus().grid, recipe, control);
}

struct Expected {
  std::string solver;
  double pearson;
};
class SolverTest : public testing::TestWithParam<Expected> {};

TEST_P(SolverTest, RecoversATorusInPhysicalUnits) {
  const auto out = run(recipe_of(GetParam().solver));
  ASSERT_TRUE(out.has_value()) << out.error().message;
  const auto m = compare(torus().truth, out->volume);
  ASSERT_TRUE(m.has_value());
  EXPECT_GT(m->pearson, GetParam().pearson);
  EXPECT_LT(m->sqmd, 0.2);
  EXPECT_GE(*std::ranges::min_element(out->volume.values), 0);
  EXPECT_LT(out->residual, 0.15);
  EXPECT_EQ(out->residual_per_view.size(), 8u);
  EXPECT_EQ(out->solver, GetParam().solver);
}

TEST_P(SolverTest, ScalesWithItsImages) {
  TorusScene bright = torus();
  for (float& v : bright.images.values) v *= 1024;
  const auto a = run(recipe_of(GetParam().solver));
  const auto b = reconstruct(bright.images, bright.rig, bright.grid, recipe_of(GetParam().solver), {});
  ASSERT_TRUE(a && b);
  for (std::size_t i = 0; i < a->volume.values.size(); i += 97) {
    EXPECT_NEAR(b->volume.values[i], 1024 * a->volume.values[i], 0.05);
  }
}

INSTANTIATE_TEST_SUITE_P(All, SolverTest,
                         testing::Values(Expected{"hessian", 0.975}, Expected{"tv", 0.975},
                                         Expected{"osem", 0.97}, Expected{"mlem", 0.97},
                                         Expected{"sirt", 0.97}, Expected{"os-sart", 0.97}),
                         [](const auto& tested) {
                           return std::string(tested.param.solver == "os-sart" ? "os_sart"
                                                                               : tested.param.solver);
                         });

TEST(Solver, ReturnsTheBestSoFarWhenCancelledOrOutOfTime) {
  std::stop_source source;
  source.request_stop();
  const auto cancelled = run(recipe_of("mlem"), {.stop = source.get_token()});
  ASSERT_TRUE(cancelled.has_value());
  EXPECT_EQ(cancelled->stop_reason, StopReason::Cancelled);
  EXPECT_EQ(cancelled->iterations, 1);
  const auto late = run(recipe_of("sirt"), {.time_limit_s = 1e-6});
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->stop_reason, StopReason::TimeLimit);
}

TEST(Solver, StopsAtTheResidualTolerance) {
  const auto out = run(recipe_of("mlem", {"stop.residual=0.2"}));
  ASSERT_TRUE(out.has_value());
  EXPECT_EQ(out->stop_reason, StopReason::Residual);
  EXPECT_LE(out->history.back().residual, 0.2);
}

TEST(Solver, ReportsEveryIteration) {
  std::vector<int> seen;
  const auto out = run(recipe_of("osem", {"osem.max_iterations=3"}),
                       {.progress = [&](const SolverProgress& p) { seen.push_back(p.iteration); }});
  ASSERT_TRUE(out.has_value());
  EXPECT_EQ(seen, (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(out->history.size(), 3u);
}

TEST(Solver, DarkImagesGiveADarkField) {
  TorusScene dark = torus();
  std::ranges::fill(dark.images.values, 0.0f);
  for (const std::string_view name : solver_names()) {
    const auto out =
        reconstruct(dark.images, dark.rig, dark.grid, recipe_of(std::string(name)), {.time_limit_s = 2});
    ASSERT_TRUE(out.has_value());
    for (float v : out->volume.values) ASSERT_EQ(v, 0) << name;
  }
}

TEST(Solver, ABadPixelIsNamedByViewRowAndColumn) {
  TorusScene bad = torus();
  bad.images.view(2)[5 * 24 + 7] = std::numeric_limits<float>::quiet_NaN();
  const auto out = reconstruct(bad.images, bad.rig, bad.grid, recipe_of("mlem"), {});
  ASSERT_FALSE(out.has_value());
  EXPECT_EQ(out.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(out.error().message.find("view cam02, row 5, column 7"), std::string::npos)
      << out.error().message;
}

TEST(Solver, ViewsThatAreNotTheRigsAreRefused) {
  TorusScene bad = torus();
  bad.images.view_names[3] = "other";
  const auto renamed = reconstruct(bad.images, bad.rig, bad.grid, recipe_of("mlem"), {});
  ASSERT_FALSE(renamed.has_value());
  EXPECT_NE(renamed.error().message.find("view 3 is other"), std::string::npos) << renamed.error().message;
  bad.images.rows = 12;
  EXPECT_FALSE(reconstruct(bad.images, bad.rig, bad.grid, recipe_of("mlem"), {}).has_value());
}

TEST(Recipe, UnknownNamesAreRefusedWithTheNearestKnownOne) {
  const auto message = [](const Recipe& recipe) {
    const auto ok = validate_recipe(recipe);
    return ok ? std::string("accepted") : ok.error().message;
  };
  EXPECT_NE(message(recipe_of("mlme")).find("did you mean 'mlem'"), std::string::npos);
  EXPECT_NE(message(recipe_of("mlem", {"mlem.max_iteration=4"})).find("did you mean 'mlem.max_iterations'"),
            std::string::npos);
  EXPECT_NE(message(recipe_of("mlem", {"projecter.step_voxels=0.4"})).find("did you mean [projector]"),
            std::string::npos);
  EXPECT_NE(message(recipe_of("mlem", {"sirt.relaxation=2.5"})).find("out of range"), std::string::npos);
  EXPECT_NE(message(recipe_of("mlem", {"constraints.non_negative=3"})).find("true or false"),
            std::string::npos);
  EXPECT_NE(message(recipe_of("mlem", {"mlem.max_iterations=3.5"})).find("whole number"), std::string::npos);
  EXPECT_NE(message(recipe_of("mlem", {"prepare.bining=3"})).find("prepare.binning"), std::string::npos);
  EXPECT_EQ(
      message(recipe_of("mlem", {"mlem.max_iterations=3", "prepare.binning=2", "projector.pixel_samples=1"})),
      "accepted");
}

TEST(Recipe, EverySettingIsDocumented) {
  std::vector<std::string_view> tables = solver_names();
  const auto shared = shared_tables();
  tables.insert(tables.end(), shared.begin(), shared.end());
  for (const std::string_view table : tables) {
    EXPECT_FALSE(settings_of(table).empty()) << table;
    for (const SettingDoc& doc : settings_of(table)) {
      EXPECT_FALSE(doc.key.empty() || doc.doc.empty() || doc.default_value.empty() || doc.range.empty())
          << table;
    }
  }
  EXPECT_EQ(Recipe().solver, solver_names().front());
}

}  // namespace
}  // namespace flamefield
