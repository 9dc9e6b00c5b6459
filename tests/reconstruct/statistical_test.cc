#include <gtest/gtest.h>

#include <cmath>

#include "reconstruct/filter.h"
#include "reconstruct/statistical/map.h"
#include "reconstruct/statistical/mlem.h"
#include "tests/reconstruct/tiny_problem.h"

namespace flamefield {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

// log p(b | x) of Poisson counts, up to what does not depend on x.
double log_likelihood(const TinyProblem& tiny, const VectorXd& b, const VectorXd& x) {
  const VectorXd mean = tiny.a * x;
  double sum = 0;
  for (Eigen::Index i = 0; i < b.size(); ++i)
    if (mean[i] > 0) sum += b[i] * std::log(mean[i]) - mean[i];
  return sum;
}

TEST(Mlem, NeverLowersTheLikelihoodAndEndsAtItsMaximum) {
  TinyProblem tiny;
  const VectorXd b = tiny.random(tiny.a.rows(), 8);
  const auto images = tiny.packed_images(b);
  double last = -INFINITY;
  VectorXd x;
  for (const int iterations : {1, 2, 3, 4, 6, 9, 15, 30, 80, 300, 3000}) {
    x = tiny.plain(solve_mlem(tiny.problem(images), {.max_iterations = iterations}).volume);
    const double now = log_likelihood(tiny, b, x);
    EXPECT_GE(now, last - 1e-6 * std::abs(last)) << iterations;
    last = now;
  }
  // At the maximum the gradient A^T (b / Ax - 1) vanishes where x > 0 and is not positive elsewhere.
  const VectorXd mean = tiny.a * x;
  const VectorXd ratio = (mean.array() > 1e-9).select(b.array() / mean.array().max(1e-9) - 1, 0);
  const VectorXd gradient = tiny.a.transpose() * ratio, sums = tiny.a.colwise().sum();
  for (Eigen::Index j = 0; j < x.size(); ++j) {
    EXPECT_LE(gradient[j], 0.02 * sums[j]) << j;
    if (x[j] > 0.01 * x.maxCoeff()) {
      EXPECT_NEAR(gradient[j], 0, 0.02 * sums[j]) << j;
    }
  }
}

TEST(Mlem, AnOrderedSubsetOfAllViewsIsOneIteration) {
  TinyProblem tiny;
  const auto images = tiny.packed_images(tiny.random(tiny.a.rows(), 8));
  const auto a = solve_mlem(tiny.problem(images), {.max_iterations = 7}),
             b = solve_mlem(tiny.problem(images), {.max_iterations = 7, .subsets = 1});
  EXPECT_EQ(a.volume, b.volume);
}

class Map : public testing::Test {
 protected:
  TinyProblem tiny;
  double sigma = 0.05, weight = 0.02;
  VectorXd b = [&] {
    Stream stream(4, 0);
    VectorXd out = tiny.a * tiny.random(tiny.a.cols(), 3);
    out /= out.maxCoeff();
    for (double& v : out) v += sigma * stream.normal();
    return out;
  }();
  std::vector<float> images = tiny.packed_images(b);
  Problem problem = [&] {
    Problem out = tiny.problem(images);
    out.noise = {.sigma = sigma};
    return out;
  }();
  MapOptions options = {
      {.weight_rule = WeightRule::Fixed, .weight = weight, .max_iterations = 5000, .tolerance = 1e-7}};
  double precision = 1 / (sigma * sigma + kLeastNoise * kLeastNoise);
  // Of the posterior: H = A^T W A + penalty L^T L.
  MatrixXd hessian = [&] {
    const double scale = precision * normal_scale(problem);
    return MatrixXd(precision * tiny.a.transpose() * tiny.a + weight * scale * tiny.gradient_penalty());
  }();

  // Sigma is averaged, as a variance, over neighbours.
  void expect_sigma(const Solution& out, const VectorXd& variance) {
    const Eigen::VectorXf single = variance.cast<float>();
    std::vector<float> smoothed =
                           tiny.projector.layout().pack_volume({single.data(), std::size_t(single.size())}),
                       scratch(smoothed.size());
    smooth(smoothed, scratch, tiny.projector.layout(), 1, tiny.team);
    const VectorXd expected = tiny.plain(smoothed).cwiseSqrt(), found = tiny.plain(out.sigma);
    for (Eigen::Index j = 0; j < expected.size(); ++j) EXPECT_NEAR(found[j] / expected[j], 1, 0.1) << j;
  }
};

TEST_F(Map, FindsTheMostProbableField) {
  options.draws = 0;
  const auto out = solve_map(problem, options);
  EXPECT_TRUE(out.sigma.empty());
  const VectorXd expected = hessian.ldlt().solve(precision * tiny.a.transpose() * b);
  expect_close(tiny.plain(out.volume), expected, 1e-3);
}

TEST_F(Map, PredictsTheScatterOfItsSolutionUnderTheNoise) {
  options.draws = 600;
  options.quadratic.tolerance = 1e-4;
  const auto out = solve_map(problem, options);
  // Covariance of H^-1 A^T W (b + noise).
  const MatrixXd gain = hessian.ldlt().solve(precision * tiny.a.transpose());
  const VectorXd variance = sigma * sigma * (gain * gain.transpose()).diagonal();
  expect_sigma(out, variance);
}

TEST_F(Map, KnowsHowUncertainTheFieldIsGivenImagesAndPrior) {
  options.draws = 300;
  options.sigma = MapSigma::Posterior;
  options.quadratic.tolerance = 1e-4;
  // Covariance H^-1; the noise is drawn without what the weights add to it.
  sigma = 0.5, problem.noise = {.sigma = sigma};
  precision = 1 / (sigma * sigma + kLeastNoise * kLeastNoise);
  for (const int order : {0, 1}) {
    options.quadratic.order = order;
    const double penalty = weight * precision * normal_scale(problem);
    const MatrixXd l =
        order == 0 ? MatrixXd(MatrixXd::Identity(tiny.a.cols(), tiny.a.cols())) : tiny.gradient_penalty();
    const MatrixXd h = precision * tiny.a.transpose() * tiny.a + penalty * l;
    SCOPED_TRACE(order);
    expect_sigma(solve_map(problem, options), h.inverse().diagonal());
  }
}

TEST_F(Map, TrustsPixelsByTheirShotNoise) {
  problem.noise = {.sigma = 0.02, .photons = 50};
  options.draws = 0;
  const VectorXd variance = 0.02 * 0.02 + b.array().max(0) / 50 + kLeastNoise * kLeastNoise;
  const VectorXd weights = variance.cwiseInverse();
  const auto packed = tiny.packed_images(weights);
  const MatrixXd h = tiny.a.transpose() * weights.asDiagonal() * tiny.a +
                     weight * normal_scale(problem, packed) * tiny.gradient_penalty();
  const VectorXd expected = h.ldlt().solve(tiny.a.transpose() * (weights.asDiagonal() * b));
  expect_close(tiny.plain(solve_map(problem, options).volume), expected, 1e-3);
}

}  // namespace
}  // namespace flamefield
