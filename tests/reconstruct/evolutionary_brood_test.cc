#include <gtest/gtest.h>

#include <cmath>

#include "reconstruct/evolutionary/brood.h"
#include "reconstruct/evolutionary/ladder.h"
#include "reconstruct/evolutionary/mask.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/problem.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// A hollow sphere in 16^3 voxels, brightest pixel 1, and a brood about it.
struct Scene {
  Grid grid = centred_grid(16, 16, 16, 1);
  Rig rig = level_ring(grid, 4);
  Team team;
  Projector projector;
  StripTable strips;
  std::vector<float> measured;  // packed, with floats to spare
  Habitat habitat;
  ErtOptions options;

  explicit Scene(int threads = 2)
      : team(threads), projector(*Projector::make(rig, grid, {}, team)), strips(projector, 0.3f, 100, team) {
    const Volume truth = make_phantom({.kind = PhantomKind::HollowSphere}, grid);
    Projections images = *render(truth, rig, {});
    const float brightest = *std::ranges::max_element(images.values);
    for (float& v : images.values) v /= brightest;
    measured = projector.layout().pack_images(images.values);
    habitat.grid = grid;
    habitat.strips = &strips;
    habitat.roughness = {grid, 0.3f, 0.02f};
    habitat.roughness_weight = 0.02;
    habitat.density = consensus_density(strips, projector.layout(), measured, team);
    measured.resize(strips.image_floats(), 0);
    options.pop_size = 64;
  }
  Mask mask() const {
    Stream stream(1, 1);
    Mask out = mask_from_field(habitat.density, 20000, stream);
    std::erase_if(out, [&](std::uint32_t v) { return !(habitat.density[v] > 0); });
    return out;
  }
  Brood brood() {
    Brood out(habitat, options, team);
    out.begin(std::vector<float>(grid.voxels(), 0), measured);
    out.set_mask(mask());
    return out;
  }
  std::vector<float> rendered(const std::vector<float>& field) {
    std::vector<float> volume = projector.layout().pack_volume(field), out(projector.layout().pixels());
    for (float& v : volume) v *= 0.3f;
    projector.forward(team, volume, out);
    out.resize(strips.image_floats(), 0);
    return out;
  }
};

TEST(StripTable, HoldsTheColumnsOfTheProjector) {
  Scene scene;
  const StripTable anew(scene.projector, 0.3f, 0, scene.team);
  ASSERT_TRUE(scene.strips.is_stored());
  ASSERT_FALSE(anew.is_stored());
  std::vector<Strip> scratch;
  for (std::size_t voxel = 0; voxel < scene.grid.voxels(); voxel += 97) {
    std::vector<float> one(scene.grid.voxels(), 0);
    one[voxel] = 1;
    const std::vector<float> expected = scene.rendered(one);
    for (const StripTable* table : {&std::as_const(scene.strips), &anew}) {
      std::vector<float> found(table->image_floats(), 0);
      for (const Strip& strip : table->of(voxel, scratch))
        for (std::size_t k = 0; k < Strip::kPixels; ++k) found[strip.first + k] += strip.weight[k];
      EXPECT_LT(relative_distance(found, expected), 1e-5) << voxel;
    }
  }
}

TEST(Ladder, ACoarseVoxelHasTheImagesOfTheFineOnesItStandsFor) {
  Scene scene;
  const Interpolation interpolation(scene.grid);
  const StripTable coarse(scene.strips, interpolation, std::vector<float>(512, 1.0f), scene.team);
  ASSERT_EQ(coarse.voxels(), 512u);
  std::vector<Strip> scratch;
  const std::vector<float> field = random_values(512, 3);
  std::vector<float> found(coarse.image_floats(), 0);
  for (std::size_t voxel = 0; voxel < 512; ++voxel)
    for (const Strip& strip : coarse.of(voxel, scratch))
      for (std::size_t k = 0; k < Strip::kPixels; ++k)
        found[strip.first + k] += field[voxel] * strip.weight[k];
  EXPECT_LT(relative_distance(found, scene.rendered(interpolation.prolong(field))), 1e-5);
}

TEST(Ladder, InterpolationKeepsConstantsAndSlopes) {
  const Grid fine = centred_grid(9, 8, 7, 1);
  const Interpolation interpolation(fine);
  const Grid& coarse = interpolation.coarse();
  EXPECT_EQ(coarse.nx, 5);
  std::vector<float> slope(coarse.voxels());
  for (std::size_t j = 0; j < slope.size(); ++j)
    slope[j] = 0.05f * static_cast<float>(coarse.voxel_centre_mm(static_cast<int>(j % 5), 0, 0).x()) + 0.5f;
  const auto out = interpolation.prolong(slope);
  for (int x = 1; x < 8; ++x)
    EXPECT_NEAR(out[fine.index(x, 3, 3)], 0.05 * fine.voxel_centre_mm(x, 0, 0).x() + 0.5, 1e-6);
  for (const float v : interpolation.prolong(std::vector<float>(coarse.voxels(), 0.7f)))
    EXPECT_NEAR(v, 0.7, 1e-6);
}

TEST(Misfit, AChangeIsWhatTheWholeSumChangesBy) {
  Scene scene;
  std::vector<float> residual = random_values(scene.strips.image_floats(), 5);
  for (float& r : residual) r -= 0.5f;
  std::fill_n(residual.end() - Strip::kPixels, Strip::kPixels, 0.0f);
  std::vector<Strip> scratch;
  for (const double p : {1.0, 2.0, 0.5, 1.5})
    for (const std::size_t voxel : {500u, 2000u, 4095u}) {
      const Misfit misfit(p);
      const auto strips = scene.strips.of(voxel, scratch);
      std::vector<float> after = residual;
      for (const Strip& strip : strips)
        for (std::size_t k = 0; k < Strip::kPixels; ++k) after[strip.first + k] -= 0.4f * strip.weight[k];
      const double expected = misfit.total(after) - misfit.total(residual);
      EXPECT_NEAR(misfit.after(strips, 0.4f, residual.data(), nullptr), expected, 1e-4) << p;
      // With a patch that takes half of the change back.
      std::vector<float> patch(residual.size(), 0), half = residual;
      for (const Strip& strip : strips)
        for (std::size_t k = 0; k < Strip::kPixels; ++k) {
          patch[strip.first + k] += 0.2f * strip.weight[k];
          half[strip.first + k] -= 0.2f * strip.weight[k];
        }
      EXPECT_NEAR(misfit.after(strips, 0.2f, residual.data(), patch.data()),
                  misfit.total(after) - misfit.total(half), 1e-4)
          << p;
    }
}

TEST(Roughness, AChangeIsWhatTheWholeSumChangesBy) {
  for (const Grid& grid : {centred_grid(7, 5, 6, 1), centred_grid(1, 2, 3, 1)}) {
    const Roughness roughness{grid, 0.4f, 0.05f};
    std::vector<float> field = random_values(grid.voxels(), 2);
    for (std::size_t voxel = 0; voxel < grid.voxels(); ++voxel) {
      const double before = total_roughness(roughness, field);
      const float change = roughness.after(voxel, 0.3f, [&](std::size_t j) { return field[j]; });
      std::vector<float> moved = field;
      moved[voxel] += 0.3f;
      EXPECT_NEAR(change, total_roughness(roughness, moved) - before, 2e-5) << voxel;
    }
  }
}

TEST(Brood, ImagesAreWithin1e5OfARenderingAfter10000Generations) {
  Scene scene;
  Brood brood = scene.brood();
  for (std::uint64_t g = 0; g < 10000; ++g) brood.evolve(1, g << 20);
  const std::vector<float> rendered = scene.rendered(brood.field());
  std::vector<float> incremental(rendered.size());
  for (std::size_t i = 0; i < rendered.size(); ++i) incremental[i] = scene.measured[i] - brood.residual()[i];
  EXPECT_LT(relative_distance(incremental, rendered), 1e-5);
  for (const float v : brood.field()) ASSERT_TRUE(v >= 0 && v <= 1);
  const double objective = brood.objective();
  brood.set_residual(std::vector<float>(brood.residual().begin(), brood.residual().end()));
  EXPECT_NEAR(objective, brood.objective(), 1e-4 * (1 + std::abs(objective)));
}

TEST(Brood, TheEliteNeverGetsWorseAndEndsFarBetter) {
  for (const double p : {1.0, 2.0, 0.7}) {
    Scene scene;
    scene.options.lp = p;
    Brood brood = scene.brood();
    const double begin = brood.objective();
    double last = begin;
    for (std::uint64_t g = 0; g < 1500; ++g) {
      brood.evolve(1, g << 20);
      ASSERT_LE(brood.objective(), last);
      last = brood.objective();
    }
    EXPECT_LT(last, 0.35 * begin) << p;
  }
}

TEST(Brood, OffspringOfManyVoxelsAreJudgedExactlyToo) {
  Scene scene;
  scene.options.mutation_intensity = 3;
  scene.options.annihilation_intensity = 2;
  scene.options.filter_intensity = 4;
  Brood brood = scene.brood();
  for (std::uint64_t g = 0; g < 400; ++g) brood.evolve(1, g << 20);
  const double objective = brood.objective();
  brood.set_residual([&] {
    std::vector<float> out = scene.rendered(brood.field());
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = scene.measured[i] - out[i];
    return out;
  }());
  EXPECT_NEAR(brood.objective(), objective, 1e-4 * std::abs(objective) + 1e-4);
}

TEST(Brood, AnyNumberOfThreadsGivesTheSameBits) {
  std::vector<std::vector<float>> fields;
  for (const int threads : {1, 2, 7}) {
    Scene scene(threads);
    Brood brood = scene.brood();
    for (std::uint64_t g = 0; g < 200; ++g) brood.evolve(3, g << 20);
    fields.push_back(brood.field());
  }
  EXPECT_EQ(fields[0], fields[1]);
  EXPECT_EQ(fields[0], fields[2]);
}

TEST(Brood, OperatorsThatARecipeSwitchesOffStayOff) {
  Scene scene;
  scene.options.filter_rate = 0;
  scene.options.crossover_rate = 0;
  Brood brood = scene.brood();
  for (std::uint64_t g = 0; g < 300; ++g) brood.evolve(1, g << 20);
  const auto made = [&](Operator op) { return brood.tallies()[static_cast<std::size_t>(op)].made; };
  EXPECT_EQ(made(Operator::Filter), 0);
  EXPECT_EQ(made(Operator::Crossover), 0);
  EXPECT_GT(made(Operator::Creep), 0);
  EXPECT_GT(made(Operator::Annihilation), 0);
  EXPECT_EQ(brood.made(), 300 * 64);
}

TEST(Brood, WhatWasSavedGoesOnAsIfNothingHadHappened) {
  Scene scene;
  Brood whole = scene.brood(), first = scene.brood(), second = scene.brood();
  for (std::uint64_t g = 0; g < 300; ++g) whole.evolve(1, g << 20);
  for (std::uint64_t g = 0; g < 120; ++g) first.evolve(1, g << 20);
  const std::string bytes = first.save();
  ASSERT_TRUE(second.load(bytes));
  for (std::uint64_t g = 120; g < 300; ++g) second.evolve(1, g << 20);
  EXPECT_EQ(second.field(), whole.field());
  EXPECT_EQ(second.made(), whole.made());
  for (const std::size_t cut : {std::size_t{0}, std::size_t{7}, bytes.size() / 2, bytes.size() - 1})
    EXPECT_FALSE(scene.brood().load(bytes.substr(0, cut))) << cut;
}

}  // namespace
}  // namespace flamefield
