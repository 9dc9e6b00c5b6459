#include "reconstruct/variational/primal_dual.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "proto/check.h"

namespace flamefield {

namespace {

// Primal against dual step length, for h x in image units, times the voxels along a ray: the field of a
// bright pixel is thinner the longer its ray. The theory allows any; with this one the flames of the tests
// settle in the fewest iterations.
constexpr double kBalance = 120;
constexpr float kUnmet = 1e-6f;  // mm; a ray or voxel with a smaller sum is not met
constexpr std::size_t kGrain = 8192;

}  // namespace

PrimalDual::PrimalDual(const Problem& problem)
    : problem_(problem),
      layout_(problem.projector.layout()),
      share_(problem.projector.share()),
      differences_(share_, layout_),
      h_mm_(problem.projector.grid().spacing_mm.minCoeff()),
      row_(layout_.pixels()),
      column_(layout_.voxels()),
      step_(layout_.voxels()),
      ax_(layout_.pixels()),
      ax_bar_(layout_.pixels()),
      dual_(layout_.pixels()),
      descent_(layout_.voxels()),
      x_(differences_.make_field()),
      x_bar_(differences_.make_field()),
      next_bar_(differences_.make_field()) {
  const Grid& grid = problem.projector.grid();
  const std::size_t pixels =
      problem.projector.views() * std::size_t(layout_.rows) * std::size_t(layout_.cols);
  problem.projector.forward(problem.team, layout_.pack_volume(std::vector<float>(grid.voxels(), 1.0f)), row_);
  problem.projector.adjoint(problem.team, layout_.pack_images(std::vector<float>(pixels, 1.0f)), column_);
  const auto met_sum = [&](const auto& value) {
    return share_.sum(layout_, [&](std::size_t begin, std::size_t end) {
      double out = 0;
      for (std::size_t j = begin; j < end; ++j)
        if (column_[j] > kUnmet) out += value(j);
      return out;
    });
  };
  const double sum = met_sum([&](std::size_t j) { return static_cast<double>(column_[j]); });
  const double met = met_sum([](std::size_t) { return 1.0; });
  for (std::size_t j = 0; j < problem.support.size(); ++j)
    if (!problem.support[j]) column_[j] = 0;
  pixels_per_voxel_ = met > 0 ? sum / met / h_mm_ : 1;
  double length = 0, rays = 0;
  for (const float r : row_) {
    length += static_cast<double>(r);
    rays += r > kUnmet ? 1 : 0;
  }
  balance_ = length > 0 ? kBalance * h_mm_ * rays / length : 1;
  const std::span<float> x = differences_.held(x_);
  std::ranges::copy(start_of(problem), x.begin());
  for (std::size_t j = 0; j < column_.size(); ++j)
    if (!(column_[j] > kUnmet)) x[j] = 0;
  std::ranges::copy(x, differences_.held(x_bar_).begin());
  problem.projector.forward(problem.team, x, ax_);
  project_forward(1);
}

void PrimalDual::set_weights(const PriorWeights& weights) {
  weights_ = weights;
  const auto prepare = [&](Differences::Dual& dual, double weight, std::size_t fields) {
    if (weight > 0 && dual.empty()) dual = differences_.make_dual(fields);
    if (!(weight > 0)) dual.clear();
  };
  prepare(gradient_dual_, weights.variation, Differences::kGradient);
  prepare(hessian_dual_, weights.hessian, Differences::kHessian);
  double prior = 0;
  if (weights.variation > 0) prior += differences_.gradient_column();
  if (weights.hessian > 0) prior += differences_.hessian_column();
  for (std::size_t j = 0; j < step_.size(); ++j) {
    const float c = column_[j];
    step_[j] =
        c > kUnmet ? static_cast<float>(balance_ / (h_mm_ * (static_cast<double>(c) + h_mm_ * prior))) : 0.0f;
  }
}

void PrimalDual::iterate(float relaxation) {
  ascend_data(relaxation);
  problem_.projector.adjoint(problem_.team, dual_, descent_);
  const auto dual_step = [&](double row, double weight) {
    return DualStep{static_cast<float>(h_mm_ / (balance_ * row)), static_cast<float>(weight), relaxation};
  };
  const Differences::Ascent gradient = {gradient_dual_,
                                        dual_step(differences_.gradient_row(), weights_.variation)};
  const Differences::Ascent hessian = {hessian_dual_,
                                       dual_step(differences_.hessian_row(), weights_.hessian)};
  differences_.iterate(problem_.team, x_bar_, gradient, hessian,
                       {.h = static_cast<float>(h_mm_),
                        .sparsity = static_cast<float>(weights_.sparsity),
                        .floor = problem_.non_negative ? 0.0f : -INFINITY,
                        .relaxation = relaxation,
                        .data = descent_.data(),
                        .step = step_.data(),
                        .x = x_.data(),
                        .bar = next_bar_.data()});
  std::swap(x_bar_, next_bar_);
  project_forward(relaxation);
}

// dual <- prox of the conjugate of 1/(2n) |. - b|^2 at dual + s A x_bar, i.e. (dual + s (A x_bar - b)) / (1 +
// s n)
void PrimalDual::ascend_data(float relaxation) {
  problem_.team.run_ranges(dual_.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    const auto n = static_cast<float>(pixels_per_voxel_), balance = static_cast<float>(balance_ / h_mm_);
    const float *row = row_.data(), *bar = ax_bar_.data(), *b = problem_.images.data();
    float* dual = dual_.data();
    for (std::size_t p = begin; p < end; ++p) {
      // With s = h / (balance_ row), both sides of the fraction divided by s.
      const float r = balance * row[p];
      const float next = row[p] > kUnmet ? (r * dual[p] + bar[p] - b[p]) / (r + n) : 0.0f;
      dual[p] += relaxation * (next - dual[p]);
    }
  });
}

// A is linear: with x_bar = 2 next - x, A next = (A x_bar + A x) / 2. Halving forgets rounding.
void PrimalDual::project_forward(float relaxation) {
  problem_.projector.forward(problem_.team, differences_.held(x_bar_), ax_bar_);
  std::vector<double> squares((ax_.size() + kGrain - 1) / kGrain, 0);
  problem_.team.run_ranges(ax_.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    double sum = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const float next = 0.5f * (ax_bar_[p] + ax_[p]);
      ax_[p] += relaxation * (next - ax_[p]);
      const double d = static_cast<double>(next) - static_cast<double>(problem_.images[p]);
      sum += d * d;
    }
    squares[begin / kGrain] = sum;
  });
  residual_square_ = 0;
  for (const double s : squares) residual_square_ += s;
}

// With f(z) = 1/(2n) |z - b|^2, f*(y) = n/2 |y|^2 + y.b, the dual objective is -f*(y) for any y and any p in
// the balls with r = A^T y + h (D^T p + sparsity) >= 0 where x may be positive. The iterates violate this a
// little; y + d 1 with d = max(-r / column sum) does not.
DualityGap PrimalDual::gap() {
  differences_.adjoint(problem_.team, gradient_dual_, hessian_dual_, next_bar_);
  const std::size_t slab = static_cast<std::size_t>(layout_.nx) * layout_.column;
  std::vector<double> lifts(static_cast<std::size_t>(layout_.nz), 0), totals(lifts.size(), 0);
  const std::span<const float> x = differences_.held(x_), slope = differences_.held(next_bar_);
  problem_.team.run(lifts.size(), [&](std::size_t z) {
    for (std::size_t j = 0; j < slab; ++j) {
      const std::size_t at = z * slab + j;
      totals[z] += static_cast<double>(x[at]);
      if (!(column_[at] > kUnmet)) continue;
      const double r =
          static_cast<double>(descent_[at]) + h_mm_ * (static_cast<double>(slope[at]) + weights_.sparsity);
      lifts[z] = std::max(lifts[z], -r / static_cast<double>(column_[at]));
    }
  });
  const double lift = share_.largest(*std::ranges::max_element(lifts)), total = share_.sum(totals);

  DualityGap out;
  double residual = 0, conjugate = 0;
  for (std::size_t p = 0; p < dual_.size(); ++p) {
    if (!(row_[p] > kUnmet)) continue;
    const double b = static_cast<double>(problem_.images[p]), y = static_cast<double>(dual_[p]) + lift;
    const double d = static_cast<double>(ax_[p]) - b;
    residual += d * d;
    conjugate += 0.5 * pixels_per_voxel_ * y * y + y * b;
  }
  out.primal = residual / (2 * pixels_per_voxel_) + weights_.sparsity * h_mm_ * total;
  if (!gradient_dual_.empty())
    out.primal += weights_.variation * h_mm_ * differences_.gradient_norm(problem_.team, x_);
  if (!hessian_dual_.empty())
    out.primal += weights_.hessian * h_mm_ * differences_.hessian_norm(problem_.team, x_);
  out.dual = problem_.non_negative ? -conjugate : -INFINITY;
  return out;
}

}  // namespace flamefield
