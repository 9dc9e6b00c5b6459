#pragma once

#include <vector>

#include "proto/volume.h"
#include "reconstruct/parallel.h"
#include "reconstruct/phantom/lattice.h"

namespace flamefield {

// A thin sheet that emits: the neighbourhood of the zero level of a function known at lattice nodes.
struct Front {
  std::vector<float> level;       // about the distance to the sheet, box sides; positive in burnt gas
  std::vector<float> brightness;  // of the sheet, 0 where the flame is locally extinct
  float thickness = 0.02f;        // standard deviation of the profile, box sides
};

// Emission of all fronts, the brightest counts, each voxel the average over its cell. Only the voxels around
// the sheets cost time.
Volume paint(const std::vector<Front>& fronts, const Lattice& lattice, const Grid& grid, Team& team);

}  // namespace flamefield
