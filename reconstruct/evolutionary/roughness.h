#pragma once

#include <cmath>

#include "proto/volume.h"

namespace flamefield {

// How uneven a field is: sum over voxels and axes of sqrt(d^2 + edge^2) - edge, with d the second difference
// of the voxel's values along the axis, in image units (field times the voxel's side). About quadratic below
// `edge`, which forgives noise no speck, and linear above, which lets a flame front be thin. Flat beyond the
// faces.
struct Roughness {
  Grid grid;
  float unit = 1;      // image units of a voxel of value 1
  float edge = 0.02f;  // image units

  float cost(float difference) const {
    const float d = unit * difference;
    return std::sqrt(d * d + edge * edge);
  }

  // Change when `voxel` changes by `change`; value(voxel) reads the field as it is before.
  template <class Value>
  float after(std::size_t voxel, float change, const Value& value) const {
    const auto nx = static_cast<std::size_t>(grid.nx), ny = static_cast<std::size_t>(grid.ny);
    const float here = value(voxel);
    return along(voxel, static_cast<int>(voxel % nx), grid.nx, 1, here, change, value) +
           along(voxel, static_cast<int>(voxel / nx % ny), grid.ny, nx, here, change, value) +
           along(voxel, static_cast<int>(voxel / nx / ny), grid.nz, nx * ny, here, change, value);
  }

 private:
  template <class Value>
  float along(std::size_t voxel, int at, int size, std::size_t stride, float here, float change,
              const Value& value) const {
    const bool has1 = at > 0, has2 = at > 1, more1 = at + 1 < size, more2 = at + 2 < size;
    // A neighbour beyond a face equals the outermost voxel, also when that is the one that changes.
    const float a1 = has1 ? value(voxel - stride) : here, a2 = has2 ? value(voxel - 2 * stride) : a1;
    const float b1 = more1 ? value(voxel + stride) : here, b2 = more2 ? value(voxel + 2 * stride) : b1;
    const float own = static_cast<float>((has1 ? 1 : 0) + (more1 ? 1 : 0));
    const float middle = a1 + b1 - 2 * here, before = a2 + here - 2 * a1, behind = b2 + here - 2 * b1;
    float sum = cost(middle - own * change) - cost(middle);
    if (has1) sum += cost(before + change) - cost(before);
    if (more1) sum += cost(behind + change) - cost(behind);
    return sum;
  }
};

// The whole of it, for tests.
template <class Field>
double total_roughness(const Roughness& roughness, const Field& field) {
  const Grid& g = roughness.grid;
  const std::size_t strides[] = {1, static_cast<std::size_t>(g.nx),
                                 static_cast<std::size_t>(g.nx) * static_cast<std::size_t>(g.ny)};
  double sum = 0;
  for (int z = 0; z < g.nz; ++z)
    for (int y = 0; y < g.ny; ++y)
      for (int x = 0; x < g.nx; ++x) {
        const std::size_t i = g.index(x, y, z);
        const int at[] = {x, y, z}, size[] = {g.nx, g.ny, g.nz};
        for (int a = 0; a < 3; ++a) {
          const float down = at[a] > 0 ? field[i - strides[a]] : field[i];
          const float up = at[a] + 1 < size[a] ? field[i + strides[a]] : field[i];
          sum += static_cast<double>(roughness.cost(down + up - 2 * field[i]) - roughness.edge);
        }
      }
  return sum;
}

}  // namespace flamefield
