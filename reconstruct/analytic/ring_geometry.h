#pragma once

#include <Eigen/Core>
#include <vector>

#include "proto/camera.h"
#include "proto/error.h"

namespace flamefield {

// A circle of level cameras that look at its axis, at even angles over half a turn or more: what filtered
// back-projection needs.
struct RingGeometry {
  Eigen::Vector3d centre_mm;  // on the axis, which is vertical, at the height of the cameras
  double radius_mm = 0;
  double step_rad = 0;      // azimuth atan2(z, x) from one camera to the next, signed
  double coverage_rad = 0;  // number of cameras times |step|
};

// InvalidInput says which camera breaks which of the conditions: undistorted; level (image columns vertical,
// line of sight horizontal); one height; one radius; the optical axis through the ring's axis; even angles,
// over at least half a turn (less one step) and at most a whole one.
Result<RingGeometry> ring_geometry(const std::vector<Camera>& cameras);

}  // namespace flamefield
