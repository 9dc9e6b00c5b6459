#pragma once

#include <vector>

#include "proto/camera.h"
#include "proto/error.h"
#include "proto/volume.h"
#include "reconstruct/area_map.h"

namespace flamefield {

// The parts of sensors that see the domain, in whole pixels and of one size, with no resampling: pose and
// lens of the cameras stay as they are.
struct SensorCrops {
  std::vector<Window> windows;
  std::vector<Camera> cameras;  // as seen through windows and binning
  int binning = 1;
};

// binning: 0: so that a merged pixel is about one voxel wide at the domain's centre. InvalidInput when not
// one merged pixel fits.
Result<SensorCrops> sensor_crops(const std::vector<Camera>& sensors, const Grid& domain, int binning,
                                 double margin_px);

}  // namespace flamefield
