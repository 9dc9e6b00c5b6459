#pragma once

#include <cstdint>
#include <vector>

#include "proto/camera.h"
#include "proto/volume.h"
#include "services/report/rgb_image.h"

namespace flamefield {

struct VolumeViewOptions {
  int width_px = 640;
  int height_px = 720;
  double azimuth_rad = 0.6;     // turntable angle about +y
  double elevation_rad = 0.30;  // above the horizontal
  double density = 50;          // optical depth across the box, were it all of the brightest emission
  double high = 0;              // emission of the brightest colour; 0: the volume's maximum
  Rgb background = {11, 13, 18};
};

// Eight bits a channel with straight (not premultiplied) opacity.
struct RgbaImage {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> bytes;  // (rows, cols, 4)
};

// A pinhole that looks at the centre of the box from a turntable angle; the box fits at every angle.
Camera turntable_camera(const Grid& grid, const VolumeViewOptions& options);

// Volume rendering: emission and absorption along each ray, front to back (Max 1995, "Optical models for
// direct volume rendering", Eq. 8), with a headlight on the gradient so that wrinkles of a flame front are
// seen as such.
RgbaImage ray_cast(const Volume& volume, const Camera& camera, const VolumeViewOptions& options);

// The same on the plain background.
RgbImage volume_view(const Volume& volume, const VolumeViewOptions& options);

}  // namespace flamefield
