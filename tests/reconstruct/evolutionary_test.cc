#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "reconstruct/evolutionary/fitness.h"
#include "reconstruct/evolutionary/mask.h"
#include "reconstruct/evolutionary/operators.h"
#include "reconstruct/evolutionary/population.h"
#include "reconstruct/metrics.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// A small problem with everything a population needs.
struct Scene {
  Grid grid = centred_grid(16, 16, 16, 1);
  Rig rig = level_ring(grid, 4);
  Volume truth = make_phantom({.kind = PhantomKind::HollowSphere}, grid);
  Projections images = *render(truth, rig, {});
  Team team{2};
  Projector projector = *Projector::make(rig, grid, {}, team);
  ColumnTable columns{projector, 100, team};
  SolveControl control;
  std::vector<float> packed = projector.layout().pack_images(images.values);
  Problem problem{projector, packed, control, team};

  Mask mask() const {
    Stream stream(1, 1);
    return mask_from_images(projector, images.values, 20000, stream);
  }
  // A x of a chromosome, rendered.
  std::vector<float> rendered(const std::vector<float>& field) {
    const Layout& layout = projector.layout();
    std::vector<float> out(layout.pixels());
    projector.forward(team, layout.pack_volume(field), out);
    return layout.unpack_images(out);
  }
};

TEST(Fitness, IsTheMeanAbsoluteDifferenceForPOne) {
  const auto a = random_values(1003, 1), b = random_values(1003, 2);
  double one = 0, two = 0, half = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = std::abs(a[i] - b[i]);
    one += d / 1003, two += d * d / 1003, half += std::sqrt(d) / 1003;
  }
  EXPECT_NEAR(distance_z(a, b, 1), one, 1e-6);
  EXPECT_NEAR(distance_z(a, b, 2), std::sqrt(two), 1e-6);
  EXPECT_NEAR(distance_z(a, b, 0.5), half * half, 1e-6);
}

TEST(Fitness, TheBestHasRelativeFitnessOneAndTheWorstZero) {
  EXPECT_EQ(relative_fitness(std::vector<double>{2, 4, 3}), (std::vector<double>{1, 0, 0.5}));
  EXPECT_EQ(relative_fitness(std::vector<double>{2, 2}), (std::vector<double>{1, 1}));
}

TEST(Fitness, TheRouletteSelectsInProportion) {
  const std::vector<double> fitness = {0, 1, 3};
  std::map<std::size_t, int> hits;
  Stream stream(5, 0);
  for (int i = 0; i < 40000; ++i) ++hits[roulette(fitness, stream)];
  EXPECT_EQ(hits[0], 0);
  EXPECT_NEAR(hits[1], 10000, 5 * std::sqrt(7500));
}

TEST(Mask, StageOneStaysInsideTheVisualHull) {
  const Scene scene;
  std::vector<float> seen(scene.grid.voxels(), 0);
  for (const std::uint32_t voxel : scene.mask()) seen[voxel] = 1;
  double core = 0, core_seen = 0;
  for (int z = 0; z < 16; ++z)
    for (int y = 0; y < 16; ++y)
      for (int x = 0; x < 16; ++x) {
        const float hit = seen[scene.grid.index(x, y, z)];
        const double r = (Eigen::Vector3d(x, y, z).array() - 7.5).matrix().norm();
        if (std::abs(y - 7.5) > 0.35 * 16 + 1.6) {
          EXPECT_EQ(hit, 0);
        }
        if (r < 3) core += 1, core_seen += hit;
      }
  EXPECT_GT(core_seen, 0.9 * core);
}

TEST(Mask, StageTwoDrawsInProportionToTheField) {
  const std::vector<float> density = {0, 1, 2, 5};
  Stream stream(3, 0);
  const std::size_t samples = 200000;
  std::map<std::uint32_t, double> hits;
  for (const std::uint32_t voxel : mask_from_field(density, samples, stream)) ++hits[voxel];
  EXPECT_LE(hits[0], 20);  // only until the chain leaves its random start
  for (std::uint32_t v = 1; v < 4; ++v) {
    EXPECT_NEAR(hits[v] / static_cast<double>(samples), density[v] / 8, 0.01);
  }
}

TEST(Mask, TheGradientOfALinearFieldIsItsSlope) {
  const Grid grid = centred_grid(5, 4, 3, 1);
  std::vector<float> field(grid.voxels());
  for (int z = 0; z < 3; ++z)
    for (int y = 0; y < 4; ++y)
      for (int x = 0; x < 5; ++x) field[grid.index(x, y, z)] = static_cast<float>(2 * x - y + 2 * z);
  for (const float g : gradient_magnitude(field, grid)) EXPECT_NEAR(g, 3, 1e-5);
}

TEST(ColumnTable, GivesTheSameEntriesStoredOrNot) {
  Scene scene;
  const ColumnTable anew(scene.projector, 0, scene.team);
  EXPECT_TRUE(scene.columns.is_stored());
  EXPECT_FALSE(anew.is_stored());
  std::vector<ColumnEntry> a, b;
  for (std::size_t voxel = 0; voxel < scene.grid.voxels(); voxel += 13) {
    const auto stored = scene.columns.of(voxel, a), fresh = anew.of(voxel, b);
    ASSERT_EQ(stored.size(), fresh.size());
    for (std::size_t i = 0; i < stored.size(); ++i) {
      EXPECT_EQ(stored[i].pixel, fresh[i].pixel);
      EXPECT_EQ(stored[i].weight, fresh[i].weight);
    }
  }
}

TEST(Chromosome, EditsChangeImagesAsARenderingWould) {
  Scene scene;
  std::vector<float> base = random_values(scene.grid.voxels(), 4);
  Chromosome c;
  c.images = scene.rendered(base);
  for (float& v : c.images) v *= 3;
  Editor editor(scene.columns, 3, base, c, true);
  Stream stream(9, 0);
  const Mask mask = scene.mask();
  for (int i = 0; i < 20; ++i) {
    mutate(editor, mask, 3, 0.3, stream);
    annihilate(editor, mask, 2, stream);
    filter(editor, mask, 4, stream);
  }
  const auto field = field_of(c, base);
  for (const float v : field) EXPECT_TRUE(v >= 0 && v <= 1);
  auto rendered = scene.rendered(field);
  for (float& v : rendered) v *= 3;
  EXPECT_LT(relative_distance(c.images, rendered), 1e-5);
}

TEST(Chromosome, TheFilterHasThePapersWeights) {
  Scene scene;
  std::vector<float> base(scene.grid.voxels(), 0);
  base[scene.grid.index(5, 5, 5)] = 1;
  Chromosome c;
  Editor editor(scene.columns, 1, base, c, false);
  Stream stream(1, 0);
  filter(editor, {static_cast<std::uint32_t>(scene.grid.index(5, 5, 5))}, 1, stream);
  EXPECT_FLOAT_EQ(editor.value(scene.grid.index(5, 5, 5)), 0.5f);
  editor.set(scene.grid.index(5, 5, 5), 1);
  filter(editor, {static_cast<std::uint32_t>(scene.grid.index(5, 6, 5))}, 1, stream);
  EXPECT_FLOAT_EQ(editor.value(scene.grid.index(5, 6, 5)), 1.0f / 12);
}

TEST(Chromosome, CrossoverIsTheVoxelWiseMeanWhateverTheBase) {
  Scene scene;
  std::vector<float> base = random_values(scene.grid.voxels(), 4);
  std::vector<Chromosome> parents(3);
  const Mask mask = scene.mask();
  for (std::size_t i = 0; i < 3; ++i) {
    parents[i].images = scene.rendered(base);
    Editor editor(scene.columns, 1, base, parents[i], true);
    Stream stream(i, 0);
    mutate(editor, mask, 50, 0.5, stream);
  }
  std::vector<std::vector<float>> fields;
  for (const Chromosome& p : parents) fields.push_back(field_of(p, base));
  rebase(parents, 1, base);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto field = field_of(parents[i], base);
    for (std::size_t v = 0; v < field.size(); ++v) ASSERT_NEAR(field[v], fields[i][v], 3e-7);
  }
  EXPECT_TRUE(parents[1].genes.empty());
  Chromosome child;
  average(parents[0], parents[2], base, child);
  const auto field = field_of(child, base);
  for (std::size_t v = 0; v < field.size(); ++v)
    ASSERT_NEAR(field[v], 0.5f * (fields[0][v] + fields[2][v]), 3e-7);
  EXPECT_LT(relative_distance(child.images, scene.rendered(field)), 1e-5);
}

TEST(Population, IncrementalImagesStayWithinTheDriftBoundOfARendering) {
  Scene scene;
  const ErtOptions options;
  Population population(scene.problem, options, 1.2f);
  const Mask mask = scene.mask();
  for (std::uint64_t g = 1; g <= 3000; ++g) population.evolve(mask, 0.1, 1, g << 16);
  for (std::size_t i = 0; i < population.members().size(); ++i) {
    auto rendered = scene.rendered(population.field(i));
    for (float& v : rendered) v *= 1.2f;
    EXPECT_LT(relative_distance(population.members()[i].images, rendered), 1e-5);
    EXPECT_NEAR(population.members()[i].z, distance_z(scene.images.values, rendered, 1),
                1e-5 * population.members()[i].z);
  }
  EXPECT_LT(population.render_anew(), 1e-5);
}

TEST(Population, IncrementalAndRenderedEvolutionAgree) {
  Scene scene;
  const Mask mask = scene.mask();
  std::vector<double> z;
  for (const bool incremental : {true, false}) {
    const ErtOptions options{.incremental = incremental};
    Population population(scene.problem, options, 1.2f);
    for (std::uint64_t g = 1; g <= 60; ++g) population.evolve(mask, 0.1, 1, g << 16);
    z.push_back(population.best().z);
  }
  EXPECT_NEAR(z[0], z[1], 1e-5 * z[1]);
}

TEST(Population, StrongElitismNeverLosesTheBest) {
  Scene scene;
  const ErtOptions options{.weak_elitism = false};
  Population population(scene.problem, options, 1.2f);
  const Mask mask = scene.mask();
  double last = population.best().z;
  for (std::uint64_t g = 1; g <= 300; ++g) {
    population.evolve(mask, 0.3, 1, g << 16);
    EXPECT_LE(population.best().z, last);
    last = population.best().z;
  }
}

}  // namespace
}  // namespace flamefield
