#pragma once

#include <ceres/problem.h>

#include <vector>

#include "calibrate/bundle.h"
#include "calibrate/reprojection.h"

namespace flamefield {

// The bundle's unknowns as Ceres wants them, in the order of its Jacobian's columns.
struct Blocks {
  std::vector<LensBlock> lenses;
  std::vector<PoseBlock> cameras, boards;
  BowBlock bow = {};
};

Blocks blocks_of(const Bundle& bundle);

// Lens parameters that are not estimated (see LensIndex).
std::vector<int> constant_lens_indices(const BundleOptions& options);
bool estimates_bow(const BundleOptions& options);

// Fills the problem, which keeps pointers into `blocks`; returns the views' residuals, one list for each
// view.
std::vector<std::vector<ceres::ResidualBlockId>> build(ceres::Problem& problem, const Bundle& bundle,
                                                       const BundleOptions& options, Blocks& blocks);

}  // namespace flamefield
