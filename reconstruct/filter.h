#pragma once

#include <span>
#include <vector>

#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"

namespace flamefield {

// volume <- (1 - share) volume + share F volume, where F is the paper's local filter, 1/2 centre + 1/12 of
// each of the six neighbours (at the faces of the box the voxel stands in for a missing neighbour). `scratch`
// has the volume's size. Both packed.
void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Layout& layout, double share,
            Team& team);
// The same of a volume of which each rank holds some planes (share.h).
void smooth(std::vector<float>& volume, std::vector<float>& scratch, const Projector& projector, double share,
            Team& team);

}  // namespace flamefield
