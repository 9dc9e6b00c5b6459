#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>

#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/registry.h"
#include "reconstruct/render.h"
#include "reconstruct/slabs.h"
#include "tests/reconstruct/support.h"
#include "tests/support/thread_ranks.h"

namespace flamefield {
namespace {

constexpr int kPlanes = 67;  // slabs of 16, 16, 16 and 19

Grid long_grid() {
  return centred_grid(64, 14, kPlanes, 1.5);
}

// Level cameras and others, pixels of finite size and not: what can part the volume.
struct View {
  const char* name;
  bool crooked;
  ProjectorOptions options;
};
class SharedProjector : public testing::TestWithParam<View> {
 protected:
  Grid grid_ = long_grid();
  Rig rig_ = GetParam().crooked ? crooked_ring(grid_, 5) : level_ring(grid_, 8);
  Team team_{1};
  Projector whole_ = *Projector::make(rig_, grid_, GetParam().options, team_);
  std::vector<float> volume_ = whole_.layout().pack_volume(random_values(grid_.voxels(), 1));
  std::vector<float> images_ = random_images();

  std::vector<float> random_images() const {
    const Layout& l = whole_.layout();
    return l.pack_images(random_values(std::size_t(l.views) * std::size_t(l.rows) * std::size_t(l.cols), 2));
  }
  // forward and adjoint by so many ranks: the images of rank 0, and the planes of all.
  struct Outcome {
    std::vector<float> images, volume;
  };
  Outcome by(int count) const {
    Outcome out;
    out.volume.resize(volume_.size());
    ThreadRanks::run(count, [&](Ranks& ranks) {
      Team team(ranks.rank() % 2 + 1);
      const Projector held = Projector::make(rig_, grid_, GetParam().options, team, &ranks).value();
      const std::size_t begin = whole_.layout().voxel(0, 0, held.share().planes().begin);
      std::vector<float> images(held.layout().pixels()), back(held.layout().voxels());
      held.forward(team, std::span(volume_).subspan(begin, back.size()), images);
      held.adjoint(team, images_, back);
      if (ranks.rank() == 0) out.images = images;
      std::ranges::copy(back, out.volume.begin() + static_cast<std::ptrdiff_t>(begin));
    });
    return out;
  }
};

TEST_P(SharedProjector, IsTheProjectorOfTheWholeWhateverTheNumberOfRanks) {
  std::vector<float> images(images_.size()), volume(volume_.size());
  whole_.forward(team_, volume_, images);
  whole_.adjoint(team_, images_, volume);
  const Outcome one = by(1);
  EXPECT_LE(relative_distance(one.images, images), 1e-6);
  EXPECT_EQ(one.volume, volume) << "each plane gathers from images by itself";
  for (const int count : {2, 3, 4}) {
    const Outcome many = by(count);
    EXPECT_EQ(many.images, one.images) << count;
    EXPECT_EQ(many.volume, one.volume) << count;
  }
}

INSTANTIATE_TEST_SUITE_P(Engines, SharedProjector,
                         testing::Values(View{"level", false, {}},
                                         View{"central_rays", false, {.pixel_area = false}},
                                         View{"out_of_focus", false, {.f_number = 2, .focal_length_mm = 20}},
                                         View{"crooked", true, {}}),
                         [](const auto& test) { return std::string(test.param.name); });

TEST(Share, CutsEveryVolumeIntoSlabsThatTheProjectorCanTake) {
  for (int nz = 1; nz <= 2100; ++nz) {
    int end = 0;
    const std::vector<Planes> slabs = slabs_of(nz);
    for (const Planes& slab : slabs) {
      ASSERT_EQ(slab.begin, end) << nz;
      ASSERT_EQ(slab.begin % 2, 0) << nz;
      ASSERT_GE(slab.count(), std::min(nz, 4)) << nz;
      end = slab.end;
    }
    ASSERT_EQ(end, nz);
    EXPECT_LE(slabs.size(), 64u);
    EXPECT_GE(slabs.size(), std::min(30u, static_cast<unsigned>(nz) / 20)) << nz;
  }
}

// A flame of the long grid.
struct Scene {
  Grid grid = long_grid();
  Rig rig = level_ring(grid, 8);
  Volume truth = make_phantom({.kind = PhantomKind::Torus}, grid);
  Projections images = *render(truth, rig, {.step_voxels = 0.5});
};
const Scene& scene() {
  static const Scene one;
  return one;
}

Recipe recipe_of(std::string_view solver, int iterations) {
  return {std::string(solver), {{concat(solver, ".max_iterations"), std::int64_t{iterations}}}};
}

// The result of rank 0.
Reconstruction solve(int count, const Recipe& recipe, const SolveControl& control = {.threads = 1}) {
  Reconstruction out;
  ThreadRanks::run(count, [&](Ranks& ranks) {
    SolveControl mine = control;
    mine.ranks = &ranks;
    auto solved = reconstruct(scene().images, scene().rig, scene().grid, recipe, mine);
    if (!solved) throw std::runtime_error(solved.error().message);
    if (ranks.rank() == 0) {
      out = std::move(*solved);
    } else {
      EXPECT_TRUE(solved->volume.values.empty()) << "only the first rank gets the volume";
    }
  });
  return out;
}

std::vector<std::string_view> sharing_solvers() {
  std::vector<std::string_view> out;
  for (const std::string_view name : solver_names())
    if (division_of(name) == Division::Slabs) out.push_back(name);
  return out;
}

class SharingSolver : public testing::TestWithParam<std::string_view> {};

TEST_P(SharingSolver, GivesTheSameBitsForAnyNumberOfRanks) {
  const Recipe recipe = recipe_of(GetParam(), 33);
  const Reconstruction one = solve(1, recipe);
  for (const int count : {2, 3, 4}) {
    const Reconstruction many = solve(count, recipe, {.threads = 2});
    EXPECT_EQ(many.volume.values, one.volume.values) << count;
    EXPECT_EQ(many.residual, one.residual) << count;
    EXPECT_EQ(many.iterations, one.iterations) << count;
    EXPECT_EQ(many.notes, one.notes) << count;
  }
}

TEST_P(SharingSolver, GivesWhatItGivesAlone) {
  const Recipe recipe = recipe_of(GetParam(), 12);
  const auto alone = reconstruct(scene().images, scene().rig, scene().grid, recipe, {.threads = 1});
  const Reconstruction shared = solve(2, recipe);
  EXPECT_EQ(shared.volume.grid, scene().grid);
  EXPECT_LE(relative_distance(shared.volume.values, alone->volume.values), 1e-4);
  EXPECT_NEAR(shared.residual, alone->residual, 1e-4 * alone->residual);
}

TEST_P(SharingSolver, TakesWarmStartsAndSupports) {
  Recipe recipe = recipe_of(GetParam(), 4);
  recipe.settings["constraints.visual_hull"] = true;
  const SolveControl control{.threads = 1, .start = &scene().truth};
  const auto alone = reconstruct(scene().images, scene().rig, scene().grid, recipe, control);
  const Reconstruction one = solve(1, recipe, control), three = solve(3, recipe, control);
  EXPECT_LE(relative_distance(one.volume.values, alone->volume.values), 1e-4);
  EXPECT_EQ(one.volume.values, three.volume.values);
}

INSTANTIATE_TEST_SUITE_P(Registry, SharingSolver, testing::ValuesIn(sharing_solvers()), [](const auto& test) {
  std::string name(test.param);
  std::erase(name, '-');
  return name;
});

TEST(Ranks, AreStoppedByTheFirst) {
  std::stop_source stop;
  std::atomic<int> cancelled = 0;
  ThreadRanks::run(3, [&](Ranks& ranks) {
    SolveControl control{.threads = 1, .ranks = &ranks};
    if (ranks.rank() == 0) {
      control.stop = stop.get_token();
      control.progress = [&](const SolverProgress& p) {
        if (p.iteration == 5) stop.request_stop();
      };
    }
    const auto out = reconstruct(scene().images, scene().rig, scene().grid, recipe_of("sirt", 1000), control);
    ASSERT_TRUE(out) << out.error().message;
    EXPECT_EQ(out->iterations, 5);
    if (out->stop_reason == StopReason::Cancelled) ++cancelled;
  });
  EXPECT_EQ(cancelled, 3);
}

TEST(Ranks, AreRefusedWhereTheyCannotHelp) {
  const auto refusal = [](int count, const Recipe& recipe) {
    std::string out;
    ThreadRanks::run(count, [&](Ranks& ranks) {
      const auto solved =
          reconstruct(scene().images, scene().rig, scene().grid, recipe, {.threads = 1, .ranks = &ranks});
      ASSERT_FALSE(solved);
      if (ranks.rank() == 0) out = solved.error().message;
    });
    return out;
  };
  EXPECT_NE(refusal(2, recipe_of("map", 5)).find("solver map on 2 ranks"), std::string::npos);
  EXPECT_NE(refusal(5, recipe_of("sirt", 5)).find("at most 4 ranks"), std::string::npos);
  Recipe traced = recipe_of("sirt", 5);
  traced.settings["projector.trilinear"] = true;
  EXPECT_NE(refusal(2, traced).find("ray tracer"), std::string::npos);
  Recipe ensemble{"ert", {{"ert.ensemble", std::int64_t{3}}}};
  EXPECT_NE(refusal(2, ensemble).find("islands"), std::string::npos);
}

// A flame small enough to evolve, on islands.
struct Evolved {
  Grid grid = centred_grid(16, 14, 16, 2.0);
  Rig rig = level_ring(grid, 8);
  Volume truth = make_phantom({.kind = PhantomKind::Torus}, grid);
  Projections images = *render(truth, rig, {.step_voxels = 0.5});

  Reconstruction on(int islands, double fitness) const {
    Reconstruction out;
    ThreadRanks::run(islands, [&](Ranks& ranks) {
      const Recipe recipe{"ert", {{"ert.fit_threshold", fitness}, {"ert.pop_size", std::int64_t{128}}}};
      auto solved = reconstruct(images, rig, grid, recipe, {.threads = 1, .ranks = &ranks});
      if (!solved) throw std::runtime_error(solved.error().message);
      if (ranks.rank() == 0) out = std::move(*solved);
    });
    return out;
  }
};

TEST(Islands, ReachAFitnessInFewerGenerations) {
  const Evolved flame;
  constexpr double kFitness = 0.98;
  const Reconstruction one = flame.on(1, kFitness), two = flame.on(2, kFitness);
  ASSERT_EQ(one.stop_reason, StopReason::Fitness) << one.history.back().fitness;
  ASSERT_EQ(two.stop_reason, StopReason::Fitness) << two.history.back().fitness;
  EXPECT_LE(two.iterations, 0.7 * one.iterations) << one.iterations;
  EXPECT_GT(compare(flame.truth, two.volume)->pearson, compare(flame.truth, one.volume)->pearson - 0.01);
}

TEST(Islands, EvolveTheSameWayAgain) {
  const Evolved flame;
  const Reconstruction first = flame.on(3, 0.97), second = flame.on(3, 0.97);
  EXPECT_EQ(first.volume.values, second.volume.values);
  EXPECT_EQ(first.iterations, second.iterations);
}

}  // namespace
}  // namespace flamefield
