#pragma once

#include <string>
#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"
#include "reconstruct/weight.h"

namespace flamefield {

// The penalised least-squares problem behind `tikhonov` and `map`:
//   J(x) = 1/2 sum_i w_i (b_i - a_i x)^2 + weight/2 |A^T W A| |L x|^2,  L = identity or gradient,
// over the constraints. The factor |A^T W A| makes the weight a pure number of about the same size for all
// images and grids.
struct QuadraticOptions {
  int order = 1;  // of the derivative in L
  WeightRule weight_rule = WeightRule::Discrepancy;
  double weight = 0.01;  // with WeightRule::Fixed
  int max_iterations = 100;
  double tolerance = 1e-4;
};
std::vector<SettingField> fields_of(QuadraticOptions& options);

struct Quadratic {
  const Problem& problem;
  std::span<const float> pixel_weights;  // w, packed; empty: 1
  std::span<const std::size_t> views;    // those that count
  int order = 1;
  double penalty = 0;                // weight |A^T W A|
  double scale = 0;                  // |A^T W A|
  std::span<const float> pull = {};  // packed volume: J gets the term -pull.x; empty: none
};

// pull = sqrt(penalty) L^T n for white n: with it (and noise in the images) the minimum of J is a draw from
// the posterior (perturb and MAP; Papandreou and Yuille, NIPS 2010). `draw` numbers the random stream.
std::vector<float> random_pull(const Quadratic& quadratic, int draw);

// How much A^T W A stretches an even field; close to its norm, as A has no negative element.
double normal_scale(const Problem& problem, std::span<const float> pixel_weights = {});

// |L x|^2, and L^T L x
double roughness(const Quadratic& quadratic, std::span<const float> x);

// Spectral projected gradient (Birgin, Martinez and Raydan, SIAM J. Optim. 10, 2000) with the step of
// Barzilai and Borwein, from x on: one forward and one adjoint an iteration. Ends when a gradient step of
// length 1 / |Hessian| changes x by less than `tolerance` |x|, or when the monitor says so; a silent trial
// only asks it about clock and stop. `images`: b.
enum class Report { Iterations, Nothing };
struct QuadraticEnd {
  int iterations = 0;
  double misfit = 0;  // sqrt(sum w_i (b_i - a_i x)^2)
  StopReason reason = StopReason::Converged;
};
QuadraticEnd minimise(const Quadratic& quadratic, std::span<const float> images, int max_iterations,
                      double tolerance, Monitor& monitor, Report report, std::vector<float>& x);

// The whole solve: weight by rule, then the field. The monitor counts the iterations of the last part.
struct QuadraticSolution {
  Solution solution;
  double weight = 0;
};
QuadraticSolution solve_quadratic(const Problem& problem, const QuadraticOptions& options,
                                  std::span<const float> pixel_weights, Monitor& monitor);

}  // namespace flamefield
