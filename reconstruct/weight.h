#pragma once

#include <functional>
#include <string>
#include <vector>

#include "reconstruct/settings.h"

namespace flamefield {

// How a regularisation weight is found.
enum class WeightRule {
  Fixed,
  Discrepancy,  // the largest whose misfit is not above the noise (Morozov, Soviet Math. Dokl. 7, 1966)
  HeldOut,      // the one that best predicts views that were kept back
  LCurve,       // the corner of log |penalty| over log |misfit| (Hansen, SIAM Rev. 34, 1992), as the point
                // farthest from its chord
};
Choice weight_rule_choice(WeightRule& rule);
std::string_view name_of(WeightRule rule);

// What a solve with one weight comes to.
struct WeightTrial {
  double misfit = 0;    // |A x - b| of the views that were used
  double penalty = 0;   // |L x|
  double held_out = 0;  // |A x - b| of the views that were kept back
};

// Views that are kept back by WeightRule::HeldOut, about one in five, and the others.
struct HeldOutViews {
  std::vector<std::size_t> used, kept_back;
};
HeldOutViews held_out_views(std::size_t views);

// Tries weights from `highest` downwards in steps of sqrt(10), each solve free to start from the one before,
// and returns the best by `rule`, interpolated between trials; at least `lowest`. `noise`: expected |noise|.
double choose_weight(WeightRule rule, double highest, double lowest, double noise,
                     const std::function<WeightTrial(double weight)>& solve);

}  // namespace flamefield
