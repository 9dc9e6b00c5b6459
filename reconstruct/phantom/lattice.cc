#include "reconstruct/phantom/lattice.h"

#include <cmath>

namespace flamefield {

std::size_t Lattice::size() const {
  return index(0, 0, nodes[2]);
}

Lattice lattice_for(const Grid& grid) {
  constexpr int kCells = 80;  // along x; eight for the shortest wrinkle
  const Eigen::Vector3d box = grid.upper_mm() - grid.lower_mm();
  Lattice lattice;
  lattice.spacing = 1.0 / kCells;
  lattice.height = box.y() / box.x();
  lattice.lower = {-0.5, 0, -0.5 * box.z() / box.x()};
  const std::array<double, 3> extent = {1, lattice.height, box.z() / box.x()};
  for (std::size_t a = 0; a < 3; ++a) {
    lattice.nodes[a] = static_cast<int>(std::ceil(extent[a] * kCells - 1e-9)) + 1;
  }
  return lattice;
}

}  // namespace flamefield
