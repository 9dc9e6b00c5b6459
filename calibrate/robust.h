#pragma once

#include <optional>

#include "calibrate/bundle.h"
#include "calibrate/calibrate.h"

namespace flamefield {

// Robustly to find the outliers, then twice without them; `used` of every view says what was left out.
// Sets the options' noise to what the residuals show.
BundleSummary solve_with_rejection(Bundle& bundle, BundleOptions& options, double reject_sigmas);

// Whether the used views tie every camera to the fixed pose.
bool hangs_together(const Bundle& bundle);

// Solves twice from disjoint halves of the poses, starting at the whole solution.
std::optional<SplitHalf> split_half(const Bundle& whole, const BundleOptions& options,
                                    const MeasuringVolume& volume);

}  // namespace flamefield
