#include "reconstruct/variational/weight_search.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/noise_model.h"
#include "reconstruct/variational/whiteness.h"

namespace flamefield {

namespace {

// Found on phantoms and simulated flames with 0 to 5 % noise.
constexpr double kModelError = 0.003;        // rms, share of the brightest pixel: what voxels cannot model
constexpr double kUsualHessian = 0.05;       // first guess of the weight, times the noise
constexpr double kUsualVariation = 0.15;     // likewise
constexpr double kGain = 4;                  // d ln weight / d ln of the squared residual's excess
constexpr double kLargestStep = 0.7;         // of ln weight
constexpr double kSettling = 0.05;           // a residual that falls by a larger share is not there yet
constexpr double kLargestShare = 3;          // of total variation, times the Hessian's weight
constexpr double kFlat = 1.1, kRich = 1.25;  // two-valuedness where the share is largest, and where it ends

}  // namespace

WeightSearch::WeightSearch(const Problem& problem, Kind kind, double known_noise)
    : kind_(kind), known_noise_(known_noise) {
  const Layout& layout = problem.projector.layout();
  const std::vector<float> nothing(layout.pixels(), 0.0f);
  const double noise =
      known_noise > 0 ? known_noise : residual_size(nothing, problem.images, layout, problem.team).fine_rms;
  const double usual =
      (kind == Kind::Variation ? kUsualVariation : kUsualHessian) * std::max(noise, kModelError);
  lowest_ = usual / 20;
  highest_ = usual * 20;
  weight_ = usual;
}

PriorWeights WeightSearch::weights() const {
  if (kind_ == Kind::Variation) return {.variation = weight_};
  return {.variation = variation_share_ * weight_, .hessian = weight_};
}

void WeightSearch::update(const Problem& problem, const PrimalDual& state) {
  const ResidualSize size =
      residual_size(state.images(), problem.images, problem.projector.layout(), problem.team);
  const double noise = known_noise_ > 0 ? known_noise_ : size.fine_rms;
  const double aim = noise * noise + kModelError * kModelError;
  // A residual that still falls says more about the iteration than about the weight.
  const bool settling = size.rms < (1 - kSettling) * last_rms_;
  last_rms_ = size.rms;
  double step = -kGain * std::log(std::max(size.rms * size.rms, 1e-30) / aim);
  if (settling) step = std::max(step, 0.0);
  weight_ = std::clamp(weight_ * std::exp(std::clamp(step, -kLargestStep, kLargestStep)), lowest_, highest_);
  const double m = two_valuedness(state.field());
  variation_share_ = kLargestShare * std::clamp((kRich - m) / (kRich - kFlat), 0.0, 1.0);
}

double two_valuedness(const GuardedVolume& x) {
  double one = 0, two = 0, three = 0;
  for (const float value : x.span()) {
    const double v = static_cast<double>(value);
    one += v;
    two += v * v;
    three += v * v * v;
  }
  return two > 0 ? one * three / (two * two) : 1;
}

}  // namespace flamefield
