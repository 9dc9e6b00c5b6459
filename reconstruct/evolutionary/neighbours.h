#pragma once

#include "proto/volume.h"

namespace flamefield {

// A voxel's six neighbours, as far as they lie inside the box: their number and sum.
struct Neighbours {
  int count = 0;
  float sum = 0;
};

// value(voxel) reads the field.
template <class Value>
Neighbours neighbours(const Grid& g, std::size_t voxel, const Value& value) {
  const auto nx = static_cast<std::size_t>(g.nx), ny = static_cast<std::size_t>(g.ny),
             nz = static_cast<std::size_t>(g.nz);
  const std::size_t x = voxel % nx, y = voxel / nx % ny, z = voxel / nx / ny;
  Neighbours out;
  const auto add = [&](bool inside, std::size_t neighbour) {
    if (!inside) return;
    ++out.count;
    out.sum += value(neighbour);
  };
  add(x > 0, voxel - 1);
  add(x + 1 < nx, voxel + 1);
  add(y > 0, voxel - nx);
  add(y + 1 < ny, voxel + nx);
  add(z > 0, voxel - nx * ny);
  add(z + 1 < nz, voxel + nx * ny);
  return out;
}

}  // namespace flamefield
