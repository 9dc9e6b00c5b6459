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
  LinearModel model{projector};
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

// The scheme of the paper with a small population.
ErtOptions paper_options() {
  ErtOptions options;
  options.scheme = ErtOptions::Scheme::Paper;
  options.pop_size = 4;
  options.lp = 1;
  options.mutation_rate = 0.8;
  options.mutation_intensity = 3;
  options.annihilation_rate = 0.3;
  options.filter_rate = 0.6;
  options.filter_intensity = 4;
  return options;
}

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
  const std::vector<double> fitness = {0, 1, 3, 0.5, 2};
  std::map<std::size_t, int> hits;
  Stream stream(5, 0);
  constexpr int kDraws = 65000;
  for (int i = 0; i < kDraws; ++i) ++hits[roulette(fitness, stream)];
  EXPECT_EQ(hits[0], 0);
  double chi_square = 0;
  for (std::size_t i = 1; i < fitness.size(); ++i) {
    const double expected = kDraws * fitness[i] / 6.5;
    chi_square += (hits[i] - expected) * (hits[i] - expected) / expected;
  }
  EXPECT_LT(chi_square, 16.27);  // three degrees of freedom, one in a thousand
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

// A chain remembers; every 64th step of one that moves in every second is as good as independent.
TEST(Mask, TheMetropolisChainHasTheTargetAsItsStationaryDistribution) {
  const std::vector<float> density = {1, 2, 3, 4, 5, 6, 7, 8};
  Stream stream(11, 0);
  const Mask chain = mask_from_field(density, 64 * 30000, stream);
  std::vector<double> hits(density.size(), 0);
  for (std::size_t i = 63; i < chain.size(); i += 64) ++hits[chain[i]];
  double chi_square = 0;
  for (std::size_t v = 0; v < density.size(); ++v) {
    const double expected = 30000.0 * static_cast<double>(density[v]) / 36;
    chi_square += (hits[v] - expected) * (hits[v] - expected) / expected;
  }
  EXPECT_LT(chi_square, 24.32);  // seven degrees of freedom, one in a thousand
}

// Johnson, Kotz and Balakrishnan, Continuous Univariate Distributions 1 (1994), Section 10.1.
TEST(Mutation, DrawsFromATruncatedNormalDistribution) {
  const auto density = [](double x) { return std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI); };
  const auto below = [](double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); };
  for (const auto& [mean, sigma] : {std::pair{0.0, 0.2}, {0.5, 0.1}, {0.9, 0.4}, {0.3, 3.0}}) {
    const double a = -mean / sigma, b = (1 - mean) / sigma, share = below(b) - below(a);
    const double shift = (density(a) - density(b)) / share;
    const double expected = mean + sigma * shift;
    const double variance = sigma * sigma * (1 + (a * density(a) - b * density(b)) / share - shift * shift);
    Stream stream(3, 1);
    constexpr int kDraws = 200000;
    double sum = 0, squares = 0;
    for (int i = 0; i < kDraws; ++i) {
      const double v = stream.truncated_normal(mean, sigma);
      ASSERT_TRUE(v >= 0 && v <= 1);
      sum += v;
      squares += v * v;
    }
    const double found = sum / kDraws;
    EXPECT_NEAR(found, expected, 5 * std::sqrt(variance / kDraws)) << mean << ' ' << sigma;
    EXPECT_NEAR(squares / kDraws - found * found, variance, 0.02 * variance) << mean << ' ' << sigma;
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
  const ErtOptions options = paper_options();
  Population population(scene.problem, options, scene.model, 1.2f);
  const Mask mask = scene.mask();
  for (std::uint64_t g = 1; g <= 10000; ++g) population.evolve(mask, 0.1, 1, g << 16);
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
    ErtOptions options = paper_options();
    options.incremental = incremental;
    Population population(scene.problem, options, scene.model, 1.2f);
    for (std::uint64_t g = 1; g <= 60; ++g) population.evolve(mask, 0.1, 1, g << 16);
    z.push_back(population.best().z);
  }
  EXPECT_NEAR(z[0], z[1], 1e-5 * z[1]);
}

TEST(Population, StrongElitismNeverLosesTheBest) {
  Scene scene;
  ErtOptions options = paper_options();
  options.weak_elitism = false;
  Population population(scene.problem, options, scene.model, 1.2f);
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
