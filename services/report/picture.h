#pragma once

#include <string>

#include "proto/error.h"
#include "proto/volume.h"
#include "services/report/rgb_image.h"

namespace flamefield {

struct VolumePictureOptions {
  int width_px = 1600;
  int height_px = 900;
  double azimuth_rad = 0.6;  // turntable angle of the rendered view
  double elevation_rad = 0.30;
  double high = 0;  // emission of the brightest colour; 0: the volume's maximum
  std::string title = "Reconstructed emission";
  std::string subtitle = {};  // after the grid's size, e.g. "pulse 17, MLEM, 15 views"
  std::string unit = "a.u.";  // of the field
};

// One dark picture of a field: a rendered view, the three central slices to one scale with axes in mm, the
// mean over each height, and the colour bar. Drawn by gnuplot: Unavailable when that is missing. InvalidInput
// for an empty volume or one with NaN or infinity, which no picture may hide.
Result<RgbImage> volume_picture(const Volume& volume, const VolumePictureOptions& options = {});

}  // namespace flamefield
