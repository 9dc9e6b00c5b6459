#pragma once

#include <span>
#include <vector>

#include "proto/volume.h"
#include "reconstruct/parallel.h"

namespace flamefield {

// volume <- (1 - share) volume + share F volume, where F is the paper's local filter, 1/2 centre + 1/12 of
// each of the six neighbours (at the faces of the box the voxel stands in for a missing neighbour). `scratch`
// has the volume's size.
void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Grid& grid, double share,
            Team& team);

}  // namespace flamefield
