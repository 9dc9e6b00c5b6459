#pragma once

#include <array>
#include <string_view>
#include <vector>

#include "proto/image.h"
#include "proto/volume.h"

namespace flamefield {

enum class Axis { X, Y, Z };
constexpr std::array<Axis, 3> kAxes = {Axis::X, Axis::Y, Axis::Z};

// A cut through a volume as it is drawn: columns run right, rows run down, both axes increase to the right
// and up.
//   normal to x: z to the right, y up      normal to y: x to the right, z up      normal to z: x to the
//   right, y up
struct Slice {
  Axis normal = Axis::Z;
  double position_mm = 0;  // along the normal
  Axis right = Axis::X, up = Axis::Y;
  std::array<double, 2> right_mm = {}, up_mm = {};  // outer edges, low and high
  Image image;
};

// Layer `index` of the voxels along the normal.
Slice slice(const Volume& volume, Axis normal, int index);
int layers(const Grid& grid, Axis normal);
inline int central_layer(const Grid& grid, Axis normal) {
  return layers(grid, normal) / 2;
}

// "x", "HAB y", "z": what an axis is called in a figure; add the unit.
std::string_view label_of(Axis axis);

// Mean over each horizontal layer, bottom first: the flame's profile against the height above the burner.
std::vector<double> mean_by_height(const Volume& volume);

// The volume averaged over whole blocks of voxels so that no side exceeds `max_side`; itself when it fits.
Volume reduced(const Volume& volume, int max_side);

}  // namespace flamefield
