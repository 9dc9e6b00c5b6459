#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numeric>

#include "reconstruct/evolutionary/camera_genes.h"
#include "reconstruct/evolutionary/model.h"
#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/solver.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

struct Scene {
  Grid grid = centred_grid(16, 14, 16, 1);
  Rig rig = level_ring(grid, 8);
  Volume truth = make_phantom({.kind = PhantomKind::Torus}, grid);
  Projections images = *render(truth, rig, {.pixel_samples = 2});
};

Recipe recipe_of(const std::string& solver, std::initializer_list<const char*> settings = {}) {
  Recipe recipe{solver, {}};
  for (const char* s : settings) EXPECT_TRUE(assign(recipe, s).has_value()) << s;
  return recipe;
}
Result<Reconstruction> run(const Scene& s, const Recipe& recipe, const SolveControl& control = {}) {
  return reconstruct(s.images, s.rig, s.grid, recipe, control);
}
double pearson(const Scene& s, const Volume& found) {
  return compare(s.truth, found)->pearson;
}
double total(const Volume& volume) {
  return std::accumulate(volume.values.begin(), volume.values.end(), 0.0);
}
bool is_dark(const Volume& volume) {
  return std::ranges::all_of(volume.values, [](float v) { return v == 0; });
}

const Recipe kPaper =
    recipe_of("ert", {"ert.scheme=paper", "ert.pop_size=6", "ert.lp=1", "ert.mutation_rate=0.8",
                      "ert.mutation_intensity=3", "ert.sigma_start=0.25", "ert.sigma=0.05",
                      "ert.sigma_generations=3000", "ert.annihilation_rate=0.3", "ert.filter_rate=0.5",
                      "ert.max_generations=8000", "ert.ma_start=3000", "ert.steps=500"});

TEST(Ert, FindsASmallTorusAndSaysHow) {
  const Scene scene;
  const auto out = run(scene, recipe_of("ert"));
  ASSERT_TRUE(out) << out.error().message;
  EXPECT_EQ(out->stop_reason, StopReason::Converged);
  EXPECT_GT(pearson(scene, out->volume), 0.97);
  EXPECT_GT(out->offspring, 1e5);
  ASSERT_FALSE(out->history.empty());
  EXPECT_GT(out->history.back().fitness, 0.98);
  EXPECT_GT(out->history.front().operator_success[0], 0);
  ASSERT_EQ(out->notes.size(), 2u);
  EXPECT_NE(out->notes[1].find("crossover"), std::string::npos);
}

TEST(Ert, ThePapersSchemeFindsItToo) {
  const Scene scene;
  const auto out = run(scene, kPaper);
  ASSERT_TRUE(out) << out.error().message;
  EXPECT_EQ(out->stop_reason, StopReason::Iterations);
  EXPECT_GT(pearson(scene, out->volume), 0.85);
  EXPECT_GT(out->history.back().fitness, 0.98);
}

TEST(Ert, TheSameSeedGivesTheSameVolumeBitForBitWhateverTheNumberOfThreads) {
  const Scene scene;
  for (Recipe recipe : {recipe_of("ert", {"ert.max_generations=400"}), kPaper,
                        recipe_of("ert-memetic", {"ert-memetic.max_generations=200"})}) {
    if (recipe.settings.contains("ert.scheme")) recipe.settings["ert.max_generations"] = std::int64_t{300};
    const auto one = run(scene, recipe, {.threads = 1, .seed = 5});
    const auto three = run(scene, recipe, {.threads = 3, .seed = 5});
    const auto other = run(scene, recipe, {.threads = 1, .seed = 6});
    ASSERT_TRUE(one && three && other);
    EXPECT_EQ(one->volume.values, three->volume.values);
    EXPECT_NE(one->volume.values, other->volume.values);
  }
}

TEST(Ert, EndsAtTheFitnessThresholdInTimeAndWhenCancelled) {
  const Scene scene;
  const auto fit = run(scene, recipe_of("ert", {"ert.fit_threshold=0.95"}));
  ASSERT_TRUE(fit.has_value());
  EXPECT_EQ(fit->stop_reason, StopReason::Fitness);
  EXPECT_GE(fit->history.back().fitness, 0.95);
  for (const char* solver : {"ert", "ert-memetic"}) {
    const auto late = run(scene, recipe_of(solver), {.time_limit_s = 1e-9});
    ASSERT_TRUE(late.has_value());
    EXPECT_EQ(late->stop_reason, StopReason::TimeLimit);
    std::stop_source source;
    source.request_stop();
    const auto cancelled = run(scene, recipe_of(solver), {.stop = source.get_token()});
    ASSERT_TRUE(cancelled.has_value());
    EXPECT_EQ(cancelled->stop_reason, StopReason::Cancelled);
  }
}

// Stops after so many generations, goes on from the last state and compares with a run in one go.
void expect_resumable(const Scene& scene, const Recipe& recipe, const Recipe& other, int stop_after) {
  std::string bytes;
  SolveControl first;
  first.checkpoint_every_s = 0;
  std::stop_source source;
  first.stop = source.get_token();
  int checkpoints = 0;
  first.checkpoint = [&](std::string_view state) {
    bytes = state;  // the last one is written when the solve ends
    if (++checkpoints == stop_after) source.request_stop();
  };
  const auto interrupted = run(scene, recipe, first);
  ASSERT_TRUE(interrupted);
  ASSERT_EQ(interrupted->stop_reason, StopReason::Cancelled);
  SolveControl rest;
  rest.resume = bytes;
  rest.threads = 3;
  const auto resumed = run(scene, recipe, rest), whole = run(scene, recipe);
  ASSERT_TRUE(resumed && whole) << resumed.error().message;
  EXPECT_EQ(resumed->volume.values, whole->volume.values);
  EXPECT_EQ(resumed->iterations, whole->iterations);
  EXPECT_EQ(resumed->offspring, whole->offspring);

  rest.seed = 9;
  EXPECT_FALSE(run(scene, recipe, rest));
  rest.seed = 1;
  for (const std::size_t kept : {bytes.size() - 1, bytes.size() / 2, std::size_t{9}, std::size_t{1}}) {
    rest.resume = std::string_view(bytes).substr(0, kept);
    EXPECT_FALSE(run(scene, recipe, rest)) << kept;
  }
  rest.resume = bytes;
  EXPECT_FALSE(run(scene, other, rest));
}

TEST(Ert, AResumedRunEqualsOneThatWasNeverInterrupted) {
  const Scene scene;
  for (const char* length : {"ert.max_generations=700", "ert.max_generations=701"}) {
    const Recipe recipe = recipe_of(
        "ert", {length, "ert.mask_samples=20000", "ert.ma_start=100", "ert.steps=90", "ert.render_every=70"});
    expect_resumable(scene, recipe, kPaper, 150);
  }
  Recipe paper = kPaper;
  for (const char* s : {"ert.max_generations=900", "ert.mask_samples=20000", "ert.ma_start=200",
                        "ert.steps=90", "ert.render_every=70"})
    ASSERT_TRUE(assign(paper, s));
  expect_resumable(scene, paper, recipe_of("ert"), 500);
}

TEST(Ert, AWarmStartSavesMostOfTheWork) {
  const Scene scene;
  Scene later;
  later.truth = make_phantom({.kind = PhantomKind::Torus, .time_s = 0.01}, scene.grid);
  later.images = *render(later.truth, later.rig, {.pixel_samples = 2});
  const auto before = run(scene, recipe_of("ert")), cold = run(later, recipe_of("ert"));
  ASSERT_TRUE(before && cold);
  const auto warm = run(later, recipe_of("ert"), {.start = &before->volume});
  ASSERT_TRUE(warm) << warm.error().message;
  EXPECT_GT(pearson(later, warm->volume), pearson(later, cold->volume) - 0.005);
  EXPECT_LT(warm->offspring, 0.6 * cold->offspring);
  const auto refused = run(later, kPaper, {.start = &before->volume});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("scheme"), std::string::npos);
}

TEST(Ert, ShowsTheBestFieldSoFarInPhysicalUnits) {
  Scene scene;
  for (float& v : scene.images.values) v *= 40;
  for (float& v : scene.truth.values) v *= 40;
  Volume seen;
  int previews = 0;
  SolveControl control;
  control.preview_every_s = 0;
  control.preview = [&](const Volume& volume) {
    seen = volume;
    ++previews;
  };
  for (const Recipe& recipe : {recipe_of("ert"), kPaper}) {
    previews = 0;
    ASSERT_TRUE(run(scene, recipe, control));
    EXPECT_GT(previews, 10);
    EXPECT_GT(pearson(scene, seen), 0.85);
    EXPECT_NEAR(total(seen) / total(scene.truth), 1, 0.1);
  }
}

TEST(Ert, AnEnsembleGivesTheMeanAndTheDeviationOfItsSeeds) {
  const Scene scene;
  const auto out = run(scene, recipe_of("ert", {"ert.ensemble=3", "ert.max_generations=300"}), {.seed = 10});
  ASSERT_TRUE(out);
  ASSERT_EQ(out->sigma.size(), scene.grid.voxels());
  std::vector<std::vector<float>> runs;
  for (const std::uint64_t seed : {10, 11, 12})
    runs.push_back(run(scene, recipe_of("ert", {"ert.max_generations=300"}), {.seed = seed})->volume.values);
  for (std::size_t j = 0; j < runs[0].size(); ++j) {
    const double a = runs[0][j], b = runs[1][j], c = runs[2][j], mean = (a + b + c) / 3;
    ASSERT_NEAR(out->volume.values[j], mean, 1e-5);
    const double square = (a - mean) * (a - mean) + (b - mean) * (b - mean) + (c - mean) * (c - mean);
    ASSERT_NEAR(out->sigma[j], std::sqrt(square / 2), 1e-4);
  }
}

TEST(ErtWithBadInput, BlackImagesGiveADarkField) {
  Scene scene;
  std::ranges::fill(scene.images.values, 0.0f);
  for (const char* solver : {"ert", "ert-memetic"}) {
    const auto out = run(scene, recipe_of(solver));
    ASSERT_TRUE(out) << solver;
    EXPECT_TRUE(is_dark(out->volume));
    EXPECT_FALSE(out->notes.empty());
  }
  EXPECT_TRUE(is_dark(run(scene, kPaper)->volume));
}

TEST(ErtWithBadInput, OneViewIsExplained) {
  Scene scene;
  scene.rig = level_ring(scene.grid, 1);
  scene.images = *render(scene.truth, scene.rig, {.pixel_samples = 2});
  for (const char* solver : {"ert", "ert-memetic"}) {
    const auto out = run(scene, recipe_of(solver));
    ASSERT_TRUE(out) << solver;
    EXPECT_LT(out->residual, 0.1) << solver;
    for (const float v : out->volume.values) ASSERT_TRUE(std::isfinite(v) && v >= 0);
  }
}

TEST(ErtWithBadInput, ViewsThatContradictEachOtherGiveAFiniteField) {
  Scene scene;
  const std::size_t pixels = scene.images.values.size() / 8;
  std::fill_n(scene.images.values.begin(), pixels, 0.0f);  // one camera sees nothing
  const auto black = run(scene, recipe_of("ert"));
  ASSERT_TRUE(black);
  EXPECT_TRUE(is_dark(black->volume));
  ASSERT_FALSE(black->notes.empty());
  EXPECT_NE(black->notes.back().find("contradict"), std::string::npos);
  std::fill_n(scene.images.values.begin(), pixels, 5.0f);  // and one that is blinded
  const auto bright = run(scene, recipe_of("ert", {"ert.max_generations=500"}));
  ASSERT_TRUE(bright);
  for (const float v : bright->volume.values) ASSERT_TRUE(std::isfinite(v) && v >= 0);
}

TEST(ErtWithBadInput, APopulationOfOneEvolves) {
  const Scene scene;
  const auto out = run(scene, recipe_of("ert", {"ert.pop_size=1", "ert.max_generations=30000"}));
  ASSERT_TRUE(out);
  EXPECT_GT(pearson(scene, out->volume), 0.6);
  const auto paper = run(scene, recipe_of("ert", {"ert.scheme=paper", "ert.pop_size=1", "ert.lp=1",
                                                  "ert.strong_elitism=false", "ert.max_generations=50"}));
  ASSERT_TRUE(paper);
  const auto elite =
      run(scene, recipe_of("ert", {"ert.scheme=paper", "ert.pop_size=1", "ert.max_generations=50"}));
  ASSERT_TRUE(elite);  // nobody but the best, who never changes
  EXPECT_TRUE(is_dark(elite->volume));
}

// Through a uniform slab of depth L: I = (1 - exp(-k f L)) / k.
TEST(SelfAbsorption, OfAUniformBodyIsTheTextbooksFormula) {
  const Grid grid = centred_grid(12, 12, 12, 1);
  Team team(2);
  const Rig rig =
      *make_ring({.views = 1, .radius_mm = 1e5, .image_width_px = 12, .image_height_px = 12}, grid);
  const Projector projector = *Projector::make(rig, grid, {}, team);
  const Layout& layout = projector.layout();
  std::vector<float> images(layout.pixels());
  const auto field = layout.pack_volume(std::vector<float>(grid.voxels(), 2));
  for (const double k : {1e-4, 0.05, 0.3}) {
    SelfAbsorption(projector, k).render(team, field, images);
    EXPECT_NEAR(images[layout.pixel(0, 6, 6)], (1 - std::exp(-k * 2 * 12)) / k, 2e-3 * 24) << k;
  }
}

TEST(CameraGenes, CountInPixels) {
  const Scene scene;
  for (std::size_t gene = 0; gene < CameraGenes::kCount; ++gene) {
    CameraGenes genes;
    genes.px[gene] = 0.5;
    const double moved =
        mean_shift_px(scene.rig.cameras[3], corrected(scene.rig.cameras[3], genes, scene.grid), scene.grid);
    EXPECT_GT(moved, 0.1) << gene;
    EXPECT_LT(moved, 0.8) << gene;
  }
}

TEST(CameraGenes, AMotionOfTheWholeRigIsTakenOut) {
  const Scene scene;
  std::vector<Camera> moved = scene.rig.cameras;
  const Rigid3 motion{Eigen::AngleAxisd(0.02, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix(),
                      Eigen::Vector3d(0.3, -0.2, 0.4)};
  for (Camera& camera : moved) camera.camera_from_world = camera.camera_from_world * motion;
  EXPECT_GT(mean_shift_px(moved[0], scene.rig.cameras[0], scene.grid), 0.2);
  for (int i = 0; i < 3; ++i) keep_gauge(moved, scene.rig.cameras, scene.grid);
  for (std::size_t v = 0; v < moved.size(); ++v)
    EXPECT_LT(mean_shift_px(moved[v], scene.rig.cameras[v], scene.grid), 0.01) << v;
}

}  // namespace
}  // namespace flamefield
