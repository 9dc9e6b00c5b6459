#pragma once

#include <cstdint>
#include <vector>

#include "proto/rig.h"

namespace flamefield {

// A ring as it stands in the laboratory: 12 mm lenses on 9.9 um pixels, mounted by hand.
struct TrueRigOptions {
  int cameras = 15;
  double spacing_rad = 0.20943951023931953;  // azimuth between neighbours (12 deg)
  double radius_mm = 600;                    // camera to ring axis
  double height_mm = 40;                     // of the ring's plane, and of the point it looks at
  int image_width_px = 659;
  int image_height_px = 494;
  double focal_px = 12.0 / 9.9e-3;
  double tolerance = 1;  // factor on all mounting tolerances below; 0: the nominal ring
  std::uint64_t seed = 1;
};

// Standard deviations at tolerance 1: azimuth 0.5 deg, radius and height 5 mm, aim 4 mm along each axis, roll
// 1 deg, focal length 0.5 %, principal point 3 px about the image centre, k1 0.02 about -0.05. Camera k
// stands at azimuth k * spacing and is named cam00, cam01, ...
Rig ring_with_tolerances(const TrueRigOptions& options);

struct BoardPosesOptions {
  int count = 24;
  double first_azimuth_rad = 0;  // the sweep of the board's normals: the ring's ends
  double last_azimuth_rad = 14 * 0.20943951023931953;
  Eigen::Vector3d centre_mm{0, 40, 0};   // above the burner exit, in the ring's plane
  double tilt_rad = 0.3490658503988659;  // about the board's own x and y axes, uniform in +-
  double roll_rad = 0.2617993877991494;  // in its plane
  double offset_mm = 25;                 // along each axis
  std::uint64_t seed = 1;
};

// world_from_board of a calibration session. Pose 0 is the board in its holder on the burner, exactly
// upright_board(centre, middle of the sweep); the others are held by hand, their normals going once around.
std::vector<Rigid3> board_poses(const BoardPosesOptions& options);

}  // namespace flamefield
