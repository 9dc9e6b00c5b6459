#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "proto/volume.h"

namespace flamefield {

// Coarse nodes over the box of a grid, on which the smooth parts of a flame (wrinkling, distance to the
// front) are evaluated. Depends on the shape of the box alone, so a flame is the same field on any grid.
// Lengths are in units of the box's x side; x and z are 0 on the axis, y is 0 at the bottom.
struct Lattice {
  std::array<int, 3> nodes = {};
  double spacing = 0;
  std::array<double, 3> lower = {};
  double height = 0;  // of the box

  std::size_t size() const;
  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(nodes[1]) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nodes[0]) +
           static_cast<std::size_t>(x);
  }
  double coordinate(std::size_t axis, int node) const { return lower[axis] + spacing * node; }
};

Lattice lattice_for(const Grid& grid);

}  // namespace flamefield
