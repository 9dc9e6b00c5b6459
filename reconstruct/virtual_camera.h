#pragma once

#include <string>
#include <vector>

#include "proto/camera.h"
#include "proto/error.h"
#include "proto/volume.h"

namespace flamefield {

// Pinholes into which sensor images are resampled once, so that everything after them is simple and fast:
// same centres, no distortion, square pixels of one width at the domain's centre, one image size that covers
// the projected domain. Level: camera frame x horizontal, y = -world y, z horizontal. Then a vertical column
// of voxels maps onto one column of pixels.
struct VirtualCameras {
  std::vector<Camera> cameras;         // in the order of the sensors
  std::vector<std::string> not_level;  // names of cameras that look too steeply; they are only undistorted
  double pixel_mm = 0;                 // side of a pixel at the domain's centre
  double sensor_px_per_pixel = 0;      // mean over the cameras, at the domain's centre
  double largest_turn_rad = 0;         // between a sensor and its virtual camera
};

// binning: sensor pixels a pixel is wide; 0: a voxel, but never less than a sensor pixel. margin_px: sensor
// pixels kept around the domain. InvalidInput when a camera stands in or behind the domain.
Result<VirtualCameras> virtual_cameras(const std::vector<Camera>& sensors, const Grid& domain, int binning,
                                       double margin_px);

}  // namespace flamefield
