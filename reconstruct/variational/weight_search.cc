#include "reconstruct/variational/weight_search.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

// Found on phantoms and simulated flames with 0 to 5 % noise.
constexpr double kModelError = 0.004;        // rms, share of the brightest pixel, of what voxels cannot model
constexpr double kEdgeError = 0.004;         // likewise, more where edges are sharp
constexpr double kUnfitted = 0.98;           // share of the noise that a field of the right weight leaves
constexpr double kUsualHessian = 0.05;       // first guess of the weight, times the aim
constexpr double kUsualVariation = 0.15;     // likewise
constexpr double kRange = 20;                // the weight stays within so many times the guess
constexpr double kGain = 4;                  // d ln weight / d ln of the squared residual's excess
constexpr double kLargestStep = 0.7;         // of ln weight
constexpr double kSettling = 0.05;           // a residual that falls by a larger share is not there yet
constexpr double kLargestShare = 6;          // of total variation, times the Hessian's weight
constexpr double kFlat = 1.1, kRich = 1.25;  // two-valuedness where the share is largest, and where it ends

double noise_rms(const Problem& problem, double pixels) {
  const Layout& layout = problem.projector.layout();
  if (!problem.noise.is_known()) return noise_level(problem.images, layout);
  double square = 0;
  for (const float b : problem.images) square += static_cast<double>(b) * static_cast<double>(b);
  return expected_residual(problem.noise, problem.images, layout) * std::sqrt(square / pixels);
}

}  // namespace

WeightSearch::WeightSearch(const Problem& problem, Kind kind) : problem_(problem), kind_(kind) {
  const Layout& layout = problem.projector.layout();
  pixels_ = static_cast<double>(layout.views) * layout.rows * layout.cols;
  noise_ = kUnfitted * noise_rms(problem, pixels_);
  usual_ = (kind == Kind::Variation ? kUsualVariation : kUsualHessian) * std::hypot(noise_, kModelError);
  weight_ = usual_;
}

PriorWeights WeightSearch::weights() const {
  if (kind_ == Kind::Variation) return {.variation = weight_};
  return {.variation = variation_share_ * weight_, .hessian = weight_};
}

void WeightSearch::update(const PrimalDual& state) {
  const double rms = std::sqrt(state.residual_square() / pixels_);
  const double m = two_valuedness(problem_.projector.share(), problem_.projector.layout(), state.field());
  const double sharpness = std::clamp((kRich - m) / (kRich - kFlat), 0.0, 1.0);
  variation_share_ = kLargestShare * sharpness;
  const double aim = std::hypot(noise_, kModelError + sharpness * kEdgeError);
  double step = rms > 0 ? -2 * kGain * std::log(rms / aim) : kLargestStep;
  // A residual that still falls says more about the iteration than about the weight.
  if (rms < (1 - kSettling) * last_rms_) step = std::max(step, 0.0);
  last_rms_ = rms;
  weight_ *= std::exp(std::clamp(step, -kLargestStep, kLargestStep));
  weight_ = std::clamp(weight_, usual_ / kRange, usual_ * kRange);
}

double two_valuedness(const Share& share, const Layout& layout, std::span<const float> x) {
  const auto sum = [&](const auto& power) {
    return share.sum(layout, [&](std::size_t begin, std::size_t end) {
      double out = 0;
      for (const float value : x.subspan(begin, end - begin)) out += power(static_cast<double>(value));
      return out;
    });
  };
  const double one = sum([](double v) { return v; }), two = sum([](double v) { return v * v; }),
               three = sum([](double v) { return v * v * v; });
  return two > 0 ? one * three / (two * two) : 1;
}

}  // namespace flamefield
