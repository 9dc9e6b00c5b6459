#pragma once

#include <string>
#include <vector>

#include "proto/camera.h"
#include "proto/error.h"
#include "proto/image.h"
#include "reconstruct/area_map.h"
#include "services/report/rgb_image.h"

namespace flamefield {

// One camera on the way from the sensor to its projection.
struct PreparationSteps {
  Camera camera;              // of the projection
  double depth_mm = 0;        // from that camera to the domain's centre, along its axis
  Image raw;                  // mean grey levels of the whole sensor
  double full_scale = 0;      // grey level of a saturated pixel; 0: the brightest one
  Window window;              // the sensor pixels that are used
  Image corrected;            // those, less dark or background, by the flat field, repaired; grey levels
  Image projection;           // field unit x mm
  std::size_t saturated = 0;  // pixels
};

// Before and after, side by side with axes and colour bars: the sensor with the part that is used, that part
// corrected, and the projection in mm at the domain's centre. Drawn by gnuplot: Unavailable when missing.
Result<RgbImage> preparation_picture(const PreparationSteps& steps, const std::string& unit);

// All cameras on one sheet, to common scales: the corrected part of the sensor and the projection.
Result<RgbImage> preparation_sheet(const std::vector<PreparationSteps>& cameras, const std::string& unit);

}  // namespace flamefield
