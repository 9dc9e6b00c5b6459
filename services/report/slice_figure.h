#pragma once

#include <string>

#include "services/report/rgb_image.h"
#include "services/report/slices.h"

namespace flamefield {

struct SliceFigureOptions {
  double px_per_mm = 3;
  bool label_right = true;  // names and tics of the axes
  bool label_up = true;
  std::string title;  // above it
};

// A slice as an <svg>: one square of colour per voxel, axes in mm, ink in the page's text colour.
std::string slice_svg(const Slice& slice, const ColourMap& map, ValueRange range,
                      const SliceFigureOptions& options);

// A colour bar as an <svg> with the ends and the middle labelled.
std::string colour_bar_svg(const ColourMap& map, ValueRange range, const std::string& label);

}  // namespace flamefield
