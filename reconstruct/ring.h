#pragma once

#include "proto/rig.h"
#include "proto/volume.h"

namespace flamefield {

// A ring of equal, undistorted pinholes in a plane of constant y, looking at the centre of the domain.
struct RingOptions {
  int views = 15;
  double spacing_rad = 0.20943951023931953;  // azimuth between neighbours (12 deg)
  double radius_mm = 300;                    // camera centre to domain centre
  double elevation_rad = 0;                  // above the horizontal plane; theta = pi/2 - elevation
  int image_width_px = 0;                    // 0: as many pixels as the domain has voxels in x (paper Fig. 2)
  int image_height_px = 0;                   // 0: as many pixels as the domain has voxels in y
};

// Camera k stands at azimuth phi = k * spacing: C = R (sin theta cos phi, cos theta, sin theta sin phi).
// Square pixels; the focal length is chosen so that the face of the box nearest the camera, at R - NZ/2,
// fills the view (paper Fig. 2). Names cam00, cam01, ...
Result<Rig> make_ring(const RingOptions& options, const Grid& domain);

}  // namespace flamefield
