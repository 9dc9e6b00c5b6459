#pragma once

#include <string>
#include <vector>

#include "calibrate/calibrate.h"
#include "calibrate/connect.h"
#include "calibrate/sightings.h"

namespace flamefield {

// For each group of cameras that hangs together apart from the connected ones: where neighbours, by the order
// of the cameras, would meet.
std::vector<MissingLink> missing_links(const Sightings& sightings, const Connected& connected);

// What to do about them.
std::string advice_text(const std::vector<MissingLink>& links);

// Cameras without any board and the commonest reason, e.g. "; cam03 saw no board in 12 images, 8 times for:
// blurred"; empty when each saw it.
std::string unseen_text(const Sightings& sightings);

}  // namespace flamefield
