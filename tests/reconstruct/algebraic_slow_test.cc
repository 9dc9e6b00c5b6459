#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "reconstruct/algebraic/art.h"
#include "reconstruct/algebraic/cgls.h"
#include "reconstruct/algebraic/mart.h"
#include "reconstruct/algebraic/row_table.h"
#include "reconstruct/algebraic/sirt.h"
#include "reconstruct/algebraic/tikhonov.h"
#include "tests/reconstruct/tiny_problem.h"

namespace flamefield {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

TEST(RowTable, HoldsTheRowsOfTheDenseMatrix) {
  TinyProblem tiny;
  const auto table = RowTable::make(tiny.projector, {}, 100, tiny.team);
  ASSERT_TRUE(table);
  ASSERT_EQ(static_cast<Eigen::Index>(table->rows()), tiny.a.rows());
  for (Eigen::Index i = 0; i < tiny.a.rows(); ++i) {
    std::vector<float> row(tiny.projector.layout().voxels(), 0);
    for (const auto& e : table->row(static_cast<std::size_t>(i))) row[e.voxel] += e.weight;
    EXPECT_LE((tiny.plain(row) - tiny.a.row(i).transpose()).norm(), 1e-6) << i;
  }
}

TEST(RowTable, TooSmallABudgetIsRefusedWithTheSizeItNeeds) {
  TinyProblem tiny;
  const auto table = RowTable::make(tiny.projector, {}, 0.001, tiny.team);
  ASSERT_FALSE(table);
  EXPECT_EQ(table.error().code, ErrorCode::InvalidInput);
  EXPECT_NE(table.error().message.find("MiB"), std::string::npos) << table.error().message;
}

TEST(Art, TakesEveryRayOnceAndNeighboursInTimeAreOfOtherViews) {
  for (const std::size_t pixels : {1u, 12u, 35u}) {
    const auto order = ray_order(7, pixels);
    EXPECT_EQ(std::set<std::uint32_t>(order.begin(), order.end()).size(), 7 * pixels);
    EXPECT_EQ(order.size(), 7 * pixels);
    for (std::size_t k = 1; k < order.size(); ++k) EXPECT_NE(order[k] / pixels, order[k - 1] / pixels);
  }
}

// Images that some field explains: every method that has no damping must find it.
class ConsistentImages : public testing::Test {
 protected:
  TinyProblem tiny;
  VectorXd truth = tiny.random(tiny.a.cols(), 3);
  std::vector<float> images = tiny.packed_images(tiny.a * truth);
};

TEST_F(ConsistentImages, AreSolvedByArt) {
  const auto out = solve_art(tiny.problem(images), {.max_iterations = 2000, .relaxation = 1, .smoothing = 0});
  ASSERT_TRUE(out);
  expect_close(tiny.plain(out->volume), truth, 0.01);
}
TEST_F(ConsistentImages, AreSolvedBySart) {
  const auto out = solve_sart(tiny.problem(images), {.sweeps = {.max_iterations = 2000}, .relaxation = 1.5});
  expect_close(tiny.plain(out.volume), truth, 0.01);
}
TEST_F(ConsistentImages, AreSolvedByOsSart) {
  const auto out =
      solve_sirt(tiny.problem(images), {.sweeps = {.max_iterations = 4000, .subsets = 2}, .relaxation = 1.9});
  expect_close(tiny.plain(out.volume), truth, 0.01);
}
TEST_F(ConsistentImages, AreSolvedByMart) {
  const auto out =
      solve_mart(tiny.problem(images),
                 {.sweeps = {.max_iterations = 8000, .subsets = 5}, .relaxation = 1, .floor = 1e-9});
  expect_close(tiny.plain(out.volume), truth, 0.02);
  for (const float v : out.volume) EXPECT_GE(v, 0);
}

// Images that no field explains: the limits are least-squares solutions.
class InconsistentImages : public testing::Test {
 protected:
  TinyProblem tiny;
  VectorXd b = tiny.random(tiny.a.rows(), 5);
  std::vector<float> images = tiny.packed_images(b);

  // min |W^(1/2) (A x - b)|^2 + x^T P x
  VectorXd solved(const MatrixXd& penalty, const VectorXd& weights) const {
    const MatrixXd h = tiny.a.transpose() * weights.asDiagonal() * tiny.a + penalty;
    return h.ldlt().solve(tiny.a.transpose() * (weights.asDiagonal() * b));
  }
  MatrixXd none() const { return MatrixXd::Zero(tiny.a.cols(), tiny.a.cols()); }
  VectorXd ones() const { return VectorXd::Ones(tiny.a.rows()); }
};

TEST_F(InconsistentImages, SirtEndsAtTheLeastSquaresWeightedByRowSums) {
  const VectorXd rows = tiny.a.rowwise().sum();
  const VectorXd weights = (rows.array() > 1e-6).select(1 / rows.array().max(0.02 * rows.maxCoeff()), 0);
  const auto out = solve_sirt(tiny.problem(images), {.sweeps = {.max_iterations = 20000}, .relaxation = 1.9});
  expect_close(tiny.plain(out.volume), solved(none(), weights), 0.01);
}

TEST_F(InconsistentImages, ArtOfShortStepsEndsNearTheLeastSquaresWeightedByRowNorms) {
  const VectorXd norms = tiny.a.rowwise().squaredNorm();
  const VectorXd weights = (norms.array() > 1e-9).select(1 / norms.array().max(0.02 * norms.maxCoeff()), 0);
  const auto out =
      solve_art(tiny.problem(images), {.max_iterations = 20000, .relaxation = 0.01, .smoothing = 0});
  ASSERT_TRUE(out);
  expect_close(tiny.plain(out->volume), solved(none(), weights), 0.05);
}

TEST_F(InconsistentImages, CglsFindsTheLeastSquaresInAsManyStepsAsUnknowns) {
  const auto out = solve_cgls(tiny.problem(images), {.max_iterations = 120, .tolerance = 1e-7});
  expect_close(tiny.plain(out.volume), solved(none(), ones()), 0.005);
}

TEST_F(InconsistentImages, CglsEndsByItsToleranceAndDampsLikeLsqr) {
  const double damping = 0.1, norm = normal_scale(tiny.problem(images));
  const auto out =
      solve_cgls(tiny.problem(images), {.max_iterations = 1000, .damping = damping, .tolerance = 1e-5});
  EXPECT_EQ(out.stop_reason, StopReason::Converged);
  EXPECT_LT(out.iterations, 100);
  const MatrixXd shift = damping * damping * norm * MatrixXd::Identity(tiny.a.cols(), tiny.a.cols());
  expect_close(tiny.plain(out.volume), solved(shift, ones()), 1e-3);
}

TEST_F(InconsistentImages, TheScaleOfTheNormalMatrixIsNearItsNorm) {
  const double norm =
      Eigen::SelfAdjointEigenSolver<MatrixXd>(tiny.a.transpose() * tiny.a).eigenvalues().maxCoeff();
  const double scale = normal_scale(tiny.problem(images));
  EXPECT_LE(scale, norm * 1.0001);
  EXPECT_GE(scale, 0.9 * norm);
}

TikhonovOptions fixed(int order, double weight) {
  return {{.order = order,
           .weight_rule = WeightRule::Fixed,
           .weight = weight,
           .max_iterations = 20000,
           .tolerance = 1e-8}};
}

TEST_F(InconsistentImages, TikhonovSolvesThePenalisedNormalEquations) {
  const double scale = normal_scale(tiny.problem(images));
  const MatrixXd identity = MatrixXd::Identity(tiny.a.cols(), tiny.a.cols());
  const auto zeroth = solve_tikhonov(tiny.problem(images), fixed(0, 0.01));
  expect_close(tiny.plain(zeroth.volume), solved(0.01 * scale * identity, ones()), 1e-3);
  const auto first = solve_tikhonov(tiny.problem(images), fixed(1, 0.01));
  expect_close(tiny.plain(first.volume), solved(0.01 * scale * tiny.gradient_penalty(), ones()), 1e-3);
}

// Coordinate descent with clipping converges to the only minimum of a strictly convex problem.
VectorXd non_negative_minimum(const MatrixXd& h, const VectorXd& c) {
  VectorXd x = VectorXd::Zero(c.size());
  for (int sweep = 0; sweep < 20000; ++sweep)
    for (Eigen::Index j = 0; j < x.size(); ++j)
      x[j] = std::max(0.0, x[j] - (h.row(j).dot(x) - c[j]) / h(j, j));
  return x;
}

TEST_F(InconsistentImages, NonNegativeTikhonovIsTheNonNegativeMinimumAndFulfilsItsConditions) {
  b.array() -= 0.45;  // so that many voxels want to be negative
  images = tiny.packed_images(b);
  const double penalty = 0.01 * normal_scale(tiny.problem(images));
  const auto out = solve_tikhonov(tiny.problem(images, true), fixed(1, 0.01));
  const VectorXd x = tiny.plain(out.volume);
  const MatrixXd h = tiny.a.transpose() * tiny.a + penalty * tiny.gradient_penalty();
  const VectorXd c = tiny.a.transpose() * b;
  const VectorXd expected = non_negative_minimum(h, c);
  ASSERT_GT((expected.array() == 0).count(), 3);
  ASSERT_GT((expected.array() > 0).count(), 3);
  expect_close(x, expected, 1e-3);
  // Karush, Kuhn and Tucker: x >= 0, gradient >= 0, and one of both zero.
  const VectorXd gradient = h * x - c;
  EXPECT_GE(x.minCoeff(), 0);
  EXPECT_GE(gradient.minCoeff(), -1e-3 * c.norm());
  EXPECT_LE(std::abs(x.dot(gradient)), 1e-3 * c.norm() * x.norm());
}

TEST_F(InconsistentImages, DiscrepancyChoosesTheWeightWhoseMisfitIsTheNoise) {
  const VectorXd truth = tiny.random(tiny.a.cols(), 3);
  Stream stream(11, 0);
  b = tiny.a * truth;
  b /= b.maxCoeff();
  const double sigma = 0.1;
  for (double& v : b) v += sigma * stream.normal();
  images = tiny.packed_images(b);
  Problem problem = tiny.problem(images, true);
  problem.noise = {.sigma = sigma};
  const auto out = solve_tikhonov(problem, {{.order = 1, .tolerance = 1e-6}});
  const double misfit = (tiny.a * tiny.plain(out.volume) - b).norm();
  EXPECT_NEAR(misfit / (sigma * std::sqrt(static_cast<double>(b.size()))), 1, 0.05);
  ASSERT_EQ(out.notes.size(), 1u);
  EXPECT_NE(out.notes[0].find("discrepancy"), std::string::npos);
}

TEST(Weight, RulesFindTheWeightTheyPromise) {
  // misfit^2 = 1 + w^2: the noise is met where w = 1 / 10.
  const auto by_noise = choose_weight(WeightRule::Discrepancy, 10, 1e-4, std::sqrt(1.01), [](double w) {
    return WeightTrial{std::sqrt(1 + w * w), 0, 0};
  });
  EXPECT_NEAR(std::log10(by_noise), -1, 0.2);
  const auto by_prediction = choose_weight(WeightRule::HeldOut, 10, 1e-4, 0, [](double w) {
    return WeightTrial{0, 0, std::pow(std::log10(w) + 1.3, 2)};
  });
  EXPECT_NEAR(std::log10(by_prediction), -1.3, 1e-6);
  // An L with its corner at w = 1 / 100.
  const auto by_corner = choose_weight(WeightRule::LCurve, 1, 1e-4, 0, [](double w) {
    return WeightTrial{1 + w / 0.01, 1 + 0.01 / w, 0};
  });
  EXPECT_NEAR(std::log10(by_corner), -2, 0.1);
}

TEST(Weight, HeldOutViewsLeaveMostForTheSolve) {
  for (const std::size_t views : {2u, 8u, 15u, 24u}) {
    const HeldOutViews split = held_out_views(views);
    EXPECT_EQ(split.used.size() + split.kept_back.size(), views);
    EXPECT_GE(split.kept_back.size(), 1u);
    EXPECT_GE(split.used.size(), split.kept_back.size());
  }
}

}  // namespace
}  // namespace flamefield
