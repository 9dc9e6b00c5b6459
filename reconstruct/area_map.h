#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "proto/camera.h"
#include "proto/image.h"

namespace flamefield {

// A rectangle of sensor pixels.
struct Window {
  int x0 = 0, y0 = 0, width = 0, height = 0;

  std::size_t pixels() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
};

// How the pixels of one camera are averages of those of another with the same centre. Each pixel of `view` is
// carried to the sensor as a quadrilateral, and takes every sensor pixel in proportion to the area they
// share. That is exact for what a pixel is, a mean over its area; nothing is interpolated, so the blur is
// that of a sensor pixel and no more. Shared corners make it conserve light.
struct AreaMap {
  int cols = 0, rows = 0;               // of the view
  Window window;                        // sensor pixels that it reads
  std::vector<std::uint32_t> begin;     // (rows * cols + 1)
  std::vector<std::uint32_t> index;     // into (window.height, window.width)
  std::vector<float> weight;            // each pixel's sum is 1
  std::vector<std::uint8_t> is_inside;  // (rows, cols): wholly on the sensor; others have no weights

  Image apply(std::span<const float> sensor) const;  // (window.height, window.width)
};

// `border_px`: sensor pixels added around what is read, as neighbours for repairs.
AreaMap area_map(const Camera& sensor, const Camera& view, int border_px);

// Whole blocks of binning x binning sensor pixels from (x0, y0) on.
AreaMap block_map(const Window& window, int binning);

// The part of a map from pixel (x0, y0) on.
AreaMap cropped(const AreaMap& map, int x0, int y0, int cols, int rows);

}  // namespace flamefield
