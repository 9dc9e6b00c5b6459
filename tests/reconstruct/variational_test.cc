#include "reconstruct/variational/variational.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "reconstruct/metrics.h"
#include "reconstruct/noise_model.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/render.h"
#include "reconstruct/variational/primal_dual.h"
#include "reconstruct/variational/weight_search.h"
#include "tests/reconstruct/support.h"

namespace flamefield {
namespace {

// ---- difference operators -------------------------------------------------------------------------------

Grid grid_of(int nx, int ny, int nz, const Eigen::Vector3d& spacing_mm) {
  Grid grid = centred_grid(nx, ny, nz, 1);
  grid.spacing_mm = spacing_mm;
  return grid;
}

GuardedVolume guarded(const Layout& layout, const std::vector<float>& packed) {
  GuardedVolume out(layout.voxels());
  std::ranges::copy(packed, out.data());
  return out;
}

// Written from the definition, one component at one voxel.
double difference(const Volume& v, std::size_t component, bool hessian, int x, int y, int z) {
  const Grid& g = v.grid;
  const double h = g.spacing_mm.minCoeff();
  const Eigen::Vector3d s = Eigen::Vector3d::Constant(h).cwiseQuotient(g.spacing_mm);
  const auto at = [&](int i, int j, int k) {
    return static_cast<double>(
        v.at(std::clamp(i, 0, g.nx - 1), std::clamp(j, 0, g.ny - 1), std::clamp(k, 0, g.nz - 1)));
  };
  const double c = at(x, y, z);
  if (!hessian) {
    const double d[3] = {at(x + 1, y, z) - c, at(x, y + 1, z) - c, at(x, y, z + 1) - c};
    return s[static_cast<Eigen::Index>(component)] * d[component];
  }
  const double d[6] = {
      s.x() * s.x() * (at(x + 1, y, z) + at(x - 1, y, z) - 2 * c),
      s.y() * s.y() * (at(x, y + 1, z) + at(x, y - 1, z) - 2 * c),
      s.z() * s.z() * (at(x, y, z + 1) + at(x, y, z - 1) - 2 * c),
      M_SQRT2 * s.x() * s.y() * (at(x + 1, y + 1, z) - at(x + 1, y, z) - at(x, y + 1, z) + c),
      M_SQRT2 * s.x() * s.z() * (at(x + 1, y, z + 1) - at(x + 1, y, z) - at(x, y, z + 1) + c),
      M_SQRT2 * s.y() * s.z() * (at(x, y + 1, z + 1) - at(x, y + 1, z) - at(x, y, z + 1) + c)};
  return d[component];
}

struct Box {
  const char* name;
  int nx, ny, nz;
  Eigen::Vector3d spacing_mm;
};
class DifferencesTest : public testing::TestWithParam<Box> {
 protected:
  Box box_ = GetParam();
  Grid grid_ = grid_of(box_.nx, box_.ny, box_.nz, box_.spacing_mm);
  Layout layout_{grid_, 1, 1, 1};
  Differences differences_{Share(grid_), layout_};
  Team team_{2};
  std::vector<float> nothing_ = std::vector<float>(layout_.voxels(), 0.0f);

  GuardedVolume random(std::uint64_t seed) const {
    return guarded(layout_, layout_.pack_volume(random_values(grid_.voxels(), seed)));
  }
  // D x: one ascent of step 1 from zero within an endless ball.
  Differences::Dual apply(GuardedVolume& x, std::size_t fields) {
    Differences::Dual none, dual = differences_.make_dual(fields);
    GuardedVolume y(layout_.voxels()), bar(layout_.voxels());
    const bool hessian = fields == Differences::kHessian;
    differences_.iterate(
        team_, x, {hessian ? none : dual, {1, 1e30f}}, {hessian ? dual : none, {1, 1e30f}},
        {.h = 1, .data = nothing_.data(), .step = nothing_.data(), .x = y.data(), .bar = bar.data()});
    return dual;
  }
};

TEST_P(DifferencesTest, AreWhatTheirDefinitionSays) {
  GuardedVolume x = random(1);
  Volume plain(grid_);
  plain.values = layout_.unpack_volume(x.span());
  for (const std::size_t fields : {Differences::kGradient, Differences::kHessian}) {
    const Differences::Dual dual = apply(x, fields);
    double norms = 0;
    for (int k = 0; k < grid_.nz; ++k)
      for (int j = 0; j < grid_.ny; ++j)
        for (int i = 0; i < grid_.nx; ++i) {
          double square = 0;
          for (std::size_t c = 0; c < fields; ++c) {
            const double expected = difference(plain, c, fields == Differences::kHessian, i, j, k);
            ASSERT_NEAR(static_cast<double>(dual[c].data()[layout_.voxel(i, j, k)]), expected, 1e-5)
                << "component " << c << " at " << i << " " << j << " " << k;
            square += expected * expected;
          }
          norms += std::sqrt(square);
        }
    const double sum = fields == Differences::kGradient ? differences_.gradient_norm(team_, x)
                                                        : differences_.hessian_norm(team_, x);
    EXPECT_NEAR(sum, norms, 1e-5 * norms + 1e-6);
  }
}

TEST_P(DifferencesTest, HaveTheirTransposeAsAdjoint) {
  GuardedVolume x = random(2), u = random(3);
  for (const std::size_t fields : {Differences::kGradient, Differences::kHessian}) {
    Differences::Dual none, dx = apply(x, fields), du = apply(u, fields);
    GuardedVolume back(layout_.voxels());
    const bool hessian = fields == Differences::kHessian;
    differences_.adjoint(team_, hessian ? none : du, hessian ? du : none, back);
    double left = 0, right = 0, size = 1e-12;
    for (std::size_t j = 0; j < layout_.voxels(); ++j) {
      for (std::size_t c = 0; c < fields; ++c) {
        left += static_cast<double>(dx[c].data()[j]) * static_cast<double>(du[c].data()[j]);
        size += static_cast<double>(du[c].data()[j]) * static_cast<double>(du[c].data()[j]);
      }
      right += static_cast<double>(x.data()[j]) * static_cast<double>(back.data()[j]);
    }
    EXPECT_NEAR(left, right, 1e-5 * size);
  }
}

TEST_P(DifferencesTest, TheFusedStepIsTheStepsOneByOne) {
  GuardedVolume bar = random(4);
  const std::vector<float> data = layout_.pack_volume(random_values(grid_.voxels(), 5));
  const std::vector<float> step = layout_.pack_volume(random_values(grid_.voxels(), 6));
  Differences::Dual gradient = differences_.make_dual(Differences::kGradient),
                    hessian = differences_.make_dual(Differences::kHessian);
  GuardedVolume x = random(7), next_bar(layout_.voxels()), back(layout_.voxels());
  const std::vector<float> before(x.span().begin(), x.span().end());
  differences_.iterate(team_, bar, {gradient, {0.3f, 0.2f}}, {hessian, {0.2f, 0.5f}},
                       {.h = 0.7f,
                        .sparsity = 0.1f,
                        .data = data.data(),
                        .step = step.data(),
                        .x = x.data(),
                        .bar = next_bar.data()});
  differences_.adjoint(team_, gradient, hessian, back);
  for (std::size_t j = 0; j < layout_.voxels(); ++j) {
    const float expected = std::max(0.0f, before[j] - step[j] * (data[j] + 0.7f * (back.data()[j] + 0.1f)));
    ASSERT_NEAR(x.data()[j], expected, 1e-5);
    ASSERT_NEAR(next_bar.data()[j], 2 * expected - before[j], 2e-5);
    double square = 0;
    for (const GuardedVolume& p : hessian) square += std::pow(static_cast<double>(p.data()[j]), 2);
    ASSERT_LE(std::sqrt(square), 0.5 * (1 + 1e-6));
  }
}

INSTANTIATE_TEST_SUITE_P(
    Boxes, DifferencesTest,
    testing::Values(Box{"cube", 9, 9, 9, {1, 1, 1}}, Box{"full_columns", 5, 16, 23, {1, 1, 1}},
                    Box{"oblong_voxels", 7, 19, 6, {0.5, 1, 0.8}}, Box{"one_voxel_deep", 8, 5, 1, {1, 1, 1}},
                    Box{"one_voxel_high", 4, 1, 17, {1, 2, 1}}, Box{"one_voxel_wide", 1, 33, 3, {1, 1, 1}}),
    [](const auto& tested) { return std::string(tested.param.name); });

// ---- a problem small enough for dense matrices ------------------------------------------------------------

struct TinyScene {
  Grid grid = centred_grid(5, 4, 5, 2);
  Team team{2};
  Rig rig = level_ring(grid, 4);
  Projector projector = *Projector::make(rig, grid, {}, team);
  const Layout& layout = projector.layout();
  std::vector<float> images;
  SolveControl control;
  Eigen::MatrixXd a;
  Eigen::VectorXd b;

  TinyScene() {
    const std::vector<float> truth = layout.pack_volume(random_values(grid.voxels(), 11));
    images.resize(layout.pixels());
    projector.forward(team, truth, images);
    std::vector<float> plain = layout.unpack_images(images);
    Stream noise(12, 0);
    for (float& v : plain) v += static_cast<float>(0.3 * noise.normal());
    const float brightest = *std::ranges::max_element(plain);
    for (float& v : plain) v /= brightest;
    images = layout.pack_images(plain);
    b = Eigen::Map<const Eigen::VectorXf>(plain.data(), static_cast<Eigen::Index>(plain.size()))
            .cast<double>();
    a = Eigen::MatrixXd::Zero(b.size(), static_cast<Eigen::Index>(grid.voxels()));
    std::vector<ColumnEntry> column;
    for (std::size_t j = 0; j < grid.voxels(); ++j) {
      projector.column(j, column);
      for (const ColumnEntry& e : column)
        a(static_cast<Eigen::Index>(e.pixel), static_cast<Eigen::Index>(j)) += static_cast<double>(e.weight);
    }
  }
  Problem problem() { return {projector, images, control, team}; }

  // All components of h D as rows, `fields` to a voxel.
  Eigen::MatrixXd dense_differences(bool hessian) const {
    const std::size_t fields = hessian ? 6 : 3;
    Eigen::MatrixXd d(static_cast<Eigen::Index>(fields * grid.voxels()),
                      static_cast<Eigen::Index>(grid.voxels()));
    for (std::size_t j = 0; j < grid.voxels(); ++j) {
      Volume unit(grid);
      unit.values[j] = 1;
      for (int z = 0; z < grid.nz; ++z)
        for (int y = 0; y < grid.ny; ++y)
          for (int x = 0; x < grid.nx; ++x)
            for (std::size_t c = 0; c < fields; ++c)
              d(static_cast<Eigen::Index>(fields * grid.index(x, y, z) + c), static_cast<Eigen::Index>(j)) =
                  grid.spacing_mm.minCoeff() * difference(unit, c, hessian, x, y, z);
    }
    return d;
  }
};

// Plain Chambolle-Pock in double precision with one step size for all (J. Math. Imaging Vis. 40, 2011).
Eigen::VectorXd dense_solution(const TinyScene& scene, double n, const PriorWeights& w) {
  const Eigen::MatrixXd gradient = scene.dense_differences(false), hessian = scene.dense_differences(true);
  Eigen::MatrixXd k(scene.a.rows() + gradient.rows() + hessian.rows(), scene.a.cols());
  k << scene.a, gradient, hessian;
  const Eigen::MatrixXd square = k.transpose() * k;
  const double norm =
                   std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(square).eigenvalues().maxCoeff()),
               tau = 0.99 / norm, sigma = tau / 1;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(k.cols()), bar = x, y = Eigen::VectorXd::Zero(k.rows());
  const auto project = [](Eigen::Ref<Eigen::VectorXd> p, Eigen::Index fields, double radius) {
    for (Eigen::Index i = 0; i < p.size(); i += fields) {
      const double size = p.segment(i, fields).norm();
      if (size > radius) p.segment(i, fields) *= radius / size;
    }
  };
  for (int i = 0; i < 10000; ++i) {
    y += sigma * (k * bar);
    y.head(scene.a.rows()) = (y.head(scene.a.rows()) - sigma * scene.b) / (1 + sigma * n);
    project(y.segment(scene.a.rows(), gradient.rows()), 3, w.variation);
    project(y.tail(hessian.rows()), 6, w.hessian);
    const Eigen::VectorXd next =
        (x - tau * (k.transpose() * y).array().matrix() -
         Eigen::VectorXd::Constant(x.size(), tau * w.sparsity * scene.grid.spacing_mm.minCoeff()))
            .cwiseMax(0);
    bar = 2 * next - x;
    x = next;
  }
  return x;
}

TEST(PrimalDual, FindsTheSolutionOfADenseReference) {
  TinyScene scene;
  for (const PriorWeights& weights : {PriorWeights{.hessian = 3e-3}, PriorWeights{.variation = 3e-3},
                                      PriorWeights{.variation = 1e-3, .hessian = 1e-3, .sparsity = 1e-3}}) {
    const Problem problem = scene.problem();
    Eigen::VectorXd expected;
    for (const float relaxation : {1.0f, 1.8f}) {
      PrimalDual state(problem);
      state.set_weights(weights);
      for (int i = 0; i < 3000; ++i) state.iterate(relaxation);
      state.iterate();
      if (expected.size() == 0) expected = dense_solution(scene, state.pixels_per_voxel(), weights);
      const std::vector<float> found = scene.layout.unpack_volume(state.field());
      for (std::size_t j = 0; j < found.size(); ++j)
        EXPECT_NEAR(static_cast<double>(found[j]), expected[static_cast<Eigen::Index>(j)],
                    2e-3 * expected.maxCoeff())
            << "relaxation " << relaxation;
    }
  }
}

TEST(PrimalDual, TheDualityGapClosesAndBoundsTheDistanceToTheSolution) {
  TinyScene scene;
  const Problem problem = scene.problem();
  const PriorWeights weights{.variation = 1e-3, .hessian = 1e-3};
  PrimalDual best(problem), state(problem);
  best.set_weights(weights);
  for (int i = 0; i < 5000; ++i) best.iterate();
  state.set_weights(weights);
  double first = 0, last = 0;
  for (int i = 1; i <= 1024; ++i) {
    state.iterate();
    if ((i & (i - 1)) != 0) continue;  // at powers of two
    const DualityGap gap = state.gap();
    double square = 0;
    for (std::size_t p = 0; p < state.images().size(); ++p)
      square += std::pow(static_cast<double>(state.images()[p] - best.images()[p]), 2);
    EXPECT_GE(gap.gap(), -1e-6 * gap.primal);
    EXPECT_LE(square / (2 * state.pixels_per_voxel()), gap.gap() + 1e-6 * gap.primal) << "iteration " << i;
    EXPECT_LE(gap.dual, best.gap().primal * (1 + 1e-6));
    if (i == 1) first = gap.gap();
    last = gap.gap();
  }
  EXPECT_LT(last, 1e-3 * first);
}

TEST(PrimalDual, WithoutAPriorItSolvesNonNegativeLeastSquares) {
  TinyScene scene;
  const Problem problem = scene.problem();
  PrimalDual none(problem), little(problem);
  little.set_weights({.hessian = 1e-7});
  none.set_weights({});
  for (int i = 0; i < 5000; ++i) {
    none.iterate();
    little.iterate();
  }
  // Karush-Kuhn-Tucker: the slope is zero where x > 0, and not negative elsewhere.
  const std::vector<float> found = scene.layout.unpack_volume(none.field());
  const Eigen::VectorXd x =
      Eigen::Map<const Eigen::VectorXf>(found.data(), static_cast<Eigen::Index>(found.size())).cast<double>();
  const Eigen::VectorXd slope = scene.a.transpose() * (scene.a * x - scene.b);
  const double size = (scene.a.transpose() * scene.b).cwiseAbs().maxCoeff();
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    EXPECT_GE(slope[j], -1e-3 * size);
    EXPECT_LE(x[j] > 1e-3 * x.maxCoeff() ? slope[j] : 0, 1e-3 * size);
  }
  EXPECT_NEAR(little.residual_square(), none.residual_square(), 1e-3 * scene.b.squaredNorm());
}

TEST(PrimalDual, StaysWithinTheSupportAndBeginsAtTheStart) {
  TinyScene scene;
  std::vector<std::uint8_t> support(scene.layout.voxels(), 1);
  for (std::size_t j = 0; j < support.size(); j += 3) support[j] = 0;
  Problem problem = scene.problem();
  problem.support = support;
  PrimalDual state(problem);
  state.set_weights({.hessian = 1e-3});
  for (int i = 0; i < 1000; ++i) state.iterate();
  for (std::size_t j = 0; j < support.size(); j += 3) ASSERT_EQ(state.field()[j], 0);
  const std::vector<float> solution(state.field().begin(), state.field().end());
  problem.start = solution;
  const PrimalDual again(problem);
  EXPECT_TRUE(std::ranges::equal(again.field(), solution));
  EXPECT_NEAR(again.residual_square(), state.residual_square(), 1e-3 * state.residual_square());
}

// ---- weights ----------------------------------------------------------------------------------------------

TEST(NoiseLevel, IsFoundUnderAFlameAndGrowingWithTheLight) {
  const auto level = [](const Projections& p, const Layout& layout) {
    return noise_level(layout.pack_images(p.values), layout);
  };
  const Grid grid = centred_grid(40, 40, 40, 1);
  const Rig rig = level_ring(grid, 6);
  const Layout layout(grid, 6, 40, 40);
  const Projections clean =
      *render(make_phantom({.kind = PhantomKind::Swirl}, grid), rig, {.pixel_samples = 3});
  const float brightest = *std::ranges::max_element(clean.values);
  EXPECT_LT(level(clean, layout), 0.012f * brightest);
  Projections even = clean, shot = clean;
  double square = 0;
  for (std::size_t i = 0; i < clean.values.size(); ++i)
    even.values[i] += static_cast<float>(0.03 * Stream(5, i).normal()) * brightest;
  EXPECT_NEAR(level(even, layout), 0.03f * brightest, 0.003f * brightest);
  ASSERT_TRUE(add_noise(shot, {.photons = 400}).has_value());
  for (std::size_t i = 0; i < clean.values.size(); ++i)
    square += std::pow(static_cast<double>(shot.values[i] - clean.values[i]), 2);
  const double rms = std::sqrt(square / static_cast<double>(clean.values.size()));
  EXPECT_NEAR(level(shot, layout), rms, 0.25 * rms);
  EXPECT_EQ(noise_level(std::vector<float>(Layout(grid, 1, 2, 2).pixels()), Layout(grid, 1, 2, 2)), 0);
}

TEST(TwoValuedness, IsOneForBodiesOfOneBrightnessAndMoreForFlames) {
  const Grid grid = centred_grid(24, 24, 24, 1);
  const Layout layout(grid, 1, 1, 1);
  const auto of = [&](const Volume& v) {
    return two_valuedness(Share(v.grid), layout, layout.pack_volume(v.values));
  };
  Volume ball(grid);
  for (std::size_t j = 0; j < grid.voxels(); j += 5) ball.values[j] = 3;
  EXPECT_NEAR(of(ball), 1, 1e-6);
  EXPECT_NEAR(of(Volume(grid)), 1, 0);
  // (1^-1.5)(3^-1.5) / (2^-1.5)^2
  EXPECT_NEAR(of(make_phantom({.kind = PhantomKind::Gaussian}, grid)), std::pow(0.75, -1.5), 0.02);
  EXPECT_GT(of(make_phantom({.kind = PhantomKind::Stratified}, grid)), 1.15);
}

struct Flame {
  Grid grid;
  Rig rig = level_ring(grid, 10, 0.31415926535897931);
  Volume fine;
  Volume truth = resample(fine, grid);
  Projections images = *render(fine, rig, {.pixel_samples = 3});

  Projections with_noise(double share) const {
    Projections out = images;
    const float brightest = *std::ranges::max_element(out.values);
    for (std::size_t i = 0; i < out.values.size(); ++i)
      out.values[i] += static_cast<float>(share * Stream(21, i).normal()) * brightest;
    return out;
  }
};
Flame flame_of(PhantomKind kind, int side) {
  return {.grid = centred_grid(side, side, side, 1.5),
          .fine = make_phantom({.kind = kind}, centred_grid(2 * side, 2 * side, 2 * side, 0.75))};
}
const Flame& flame() {
  static const Flame one = flame_of(PhantomKind::Bunsen, 24);
  return one;
}

TEST(PrimalDual, OverRelaxedItNeedsThreeQuartersOfTheIterationsAtMost) {
  Team team(2);
  const Projector projector = *Projector::make(flame().rig, flame().grid, {}, team);
  std::vector<float> images = projector.layout().pack_images(flame().with_noise(0.02).values);
  const float brightest = *std::ranges::max_element(images);
  for (float& v : images) v /= brightest;
  const SolveControl control;
  const Problem problem{projector, images, control, team};
  const auto field_after = [&](float relaxation, int iterations) {
    PrimalDual state(problem);
    state.set_weights({.hessian = 1e-3});
    for (int i = 1; i <= iterations; ++i) state.iterate(i == iterations ? 1 : relaxation);
    for (const float v : state.field()) EXPECT_GE(v, 0);
    return std::vector<float>(state.field().begin(), state.field().end());
  };
  const std::vector<float> solution = field_after(1, 2000);
  for (const int iterations : {20, 40, 80, 160})
    EXPECT_LT(relative_distance(field_after(1.8f, iterations * 3 / 4), solution),
              relative_distance(field_after(1, iterations), solution))
        << iterations << " iterations";
}

Recipe recipe_of(const std::string& solver, std::initializer_list<const char*> settings = {}) {
  Recipe recipe{solver, {}};
  for (const char* s : settings) EXPECT_TRUE(assign(recipe, s).has_value());
  return recipe;
}

Result<Reconstruction> solve(const Projections& images, const Recipe& recipe,
                             const SolveControl& control = {}) {
  return reconstruct(images, flame().rig, flame().grid, recipe, control);
}

PriorWeights weights_of(const Reconstruction& r) {
  PriorWeights out;
  for (const std::string& note : r.notes)
    if (std::sscanf(note.c_str(), "weights found: Hessian %lf, total variation %lf", &out.hessian,
                    &out.variation) == 2)
      return out;
  ADD_FAILURE() << "no weights among the notes";
  return out;
}

// rms of the residual over the brightest pixel
double residual_share(const Reconstruction& r, const Projections& images) {
  double square = 0;
  for (const float v : images.values) square += static_cast<double>(v) * static_cast<double>(v);
  return r.residual * std::sqrt(square / static_cast<double>(images.values.size())) /
         static_cast<double>(*std::ranges::max_element(images.values));
}

TEST(Variational, TheWeightFoundGrowsWithTheNoise) {
  const Flame smooth = flame_of(PhantomKind::Swirl, 40);  // seen by pixels that resolve it
  for (const char* solver : {"hessian", "tv"}) {
    double before = 0;
    for (const double noise : {0.0, 0.02, 0.06}) {
      const auto out = reconstruct(smooth.with_noise(noise), smooth.rig, smooth.grid, recipe_of(solver), {});
      ASSERT_TRUE(out.has_value());
      const PriorWeights w = weights_of(*out);
      EXPECT_GT(w.hessian + w.variation, 1.3 * before) << solver << " at " << noise;
      before = w.hessian + w.variation;
    }
  }
}

TEST(Variational, TheWeightFoundIsNearlyTheBest) {
  const Projections images = flame().with_noise(0.03);
  const auto found = solve(images, recipe_of("hessian"));
  ASSERT_TRUE(found.has_value());
  double best = 0;
  for (const char* weight : {"hessian.weight=3e-4", "hessian.weight=6e-4", "hessian.weight=1.2e-3",
                             "hessian.weight=2.5e-3", "hessian.weight=5e-3"})
    best = std::max(best,
                    compare(flame().truth, solve(images, recipe_of("hessian", {weight}))->volume)->pearson);
  EXPECT_GT(compare(flame().truth, found->volume)->pearson, best - 0.003);
}

TEST(Variational, AKnownNoiseTakesThePlaceOfTheEstimate) {
  const Projections images = flame().with_noise(0.03);
  const auto told = solve(images, recipe_of("hessian", {"noise.sigma=0.03"})),
             told_more = solve(images, recipe_of("hessian", {"noise.sigma=0.05"}));
  ASSERT_TRUE(told && told_more);
  EXPECT_NEAR(residual_share(*told, images), 0.03, 0.002);
  EXPECT_GT(residual_share(*told_more, images), 0.037);
}

TEST(Variational, DoesNotDependOnTheUnitOfLength) {
  const Projections images = flame().with_noise(0.02);
  Grid metres = flame().grid;
  metres.spacing_mm *= 1024;
  metres.origin_mm *= 1024;
  Rig rig = flame().rig;
  for (Camera& camera : rig.cameras) camera.camera_from_world.translation_mm *= 1024;
  const auto here = solve(images, recipe_of("hessian"));
  auto there = reconstruct(images, rig, metres, recipe_of("hessian"), {});
  ASSERT_TRUE(here && there);
  for (float& v : there->volume.values) v *= 1024;
  EXPECT_LT(relative_distance(there->volume.values, here->volume.values), 1e-3);
}

TEST(Variational, IsBitIdenticalForOneTwoAndSevenThreads) {
  for (const char* solver : {"hessian", "tv"}) {
    const Recipe recipe = recipe_of(solver);
    const Projections images = flame().with_noise(0.02);
    const auto one = solve(images, recipe, {.threads = 1}), two = solve(images, recipe, {.threads = 2}),
               seven = solve(images, recipe, {.threads = 7});
    ASSERT_TRUE(one && two && seven);
    EXPECT_EQ(one->volume.values, two->volume.values);
    EXPECT_EQ(one->volume.values, seven->volume.values);
    EXPECT_EQ(one->notes, seven->notes);
  }
}

TEST(Variational, StopsWhenTheGapIsSmallEnough) {
  const auto out =
      solve(flame().images, recipe_of("hessian", {"hessian.weight=1e-3", "hessian.gap_tolerance=0.01",
                                                  "hessian.max_iterations=1000"}));
  ASSERT_TRUE(out.has_value());
  EXPECT_EQ(out->stop_reason, StopReason::Converged);
  EXPECT_LT(out->iterations, 500);
}

TEST(Variational, ReturnsTheBestSoFarWhenCancelledOrOutOfTime) {
  std::stop_source source;
  int seen = 0;
  const auto cancelled = solve(flame().images, recipe_of("hessian"),
                               {.stop = source.get_token(), .progress = [&](const SolverProgress& p) {
                                  seen = p.iteration;
                                  if (p.iteration == 30) source.request_stop();
                                }});
  ASSERT_TRUE(cancelled.has_value());
  EXPECT_EQ(cancelled->stop_reason, StopReason::Cancelled);
  EXPECT_EQ(seen, 30);
  EXPECT_GT(compare(flame().truth, cancelled->volume)->pearson, 0.9);
  const auto late = solve(flame().images, recipe_of("tv"), {.time_limit_s = 1e-6});
  ASSERT_TRUE(late.has_value());
  EXPECT_EQ(late->stop_reason, StopReason::TimeLimit);
}

}  // namespace
}  // namespace flamefield
