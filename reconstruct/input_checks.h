#pragma once

#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"
#include "proto/volume.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"

namespace flamefield {

// Every value finite, views of the projector's names and sizes; InvalidInput names view, row and column.
Result<> check_views(const Projections& projections, const Projector& projector);

// A camera without any ray through the box is a mistake in rig, grid or units: InvalidInput names it.
Result<> check_sight(const Projector& projector, Team& team);

// A warm start is finite and on the same grid.
Result<> check_start(const Volume& start, const Grid& grid);

// What a user should know about images that are taken all the same: many pixels at exactly the brightest
// value look like a sensor at its full scale.
std::vector<std::string> notes_about(const Projections& projections);

}  // namespace flamefield
