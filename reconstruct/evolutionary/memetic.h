#pragma once

#include <vector>

#include "reconstruct/evolutionary/ert.h"

namespace flamefield {

// The paper's "hybrid" of its introduction: an operator that improves a whole field by algebraic sweeps
// stands beside those that change single voxels.
struct MemeticOptions {
  ErtOptions ert = {.levels = 1, .roughness = 0.0015, .tolerance = 1e-3};
  int sweeps = 150;  // of the regularised algebraic solver, on the first of the two parents
};
std::vector<SettingField> memetic_fields(MemeticOptions& options);

// Two parents: a dark field improved by sweeps, and what evolution makes of it. The result is their
// crossover, the voxel-wise mean: misfit and roughness are convex, so it is no worse than the parents'
// average, and what either got wrong on its own is halved.
Result<Solution> solve_memetic(const Problem& problem, const MemeticOptions& options);

}  // namespace flamefield
