#include "proto/volume.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

Grid centred_grid(int nx, int ny, int nz, double spacing_mm) {
  Grid grid{nx, ny, nz, Eigen::Vector3d::Constant(spacing_mm), Eigen::Vector3d::Zero()};
  grid.origin_mm = -0.5 * spacing_mm * Eigen::Vector3d(nx - 1, ny - 1, nz - 1);
  return grid;
}

Result<> validate(const Grid& grid) {
  if (grid.nx <= 0 || grid.ny <= 0 || grid.nz <= 0) {
    return invalid_input(concat("grid of ", grid.nx, "x", grid.ny, "x", grid.nz, " voxels"),
                         "each side must be positive", "set --size NX,NY,NZ");
  }
  const double voxels = static_cast<double>(grid.nx) * grid.ny * grid.nz;
  if (voxels > 8589934592.0) {
    return invalid_input(concat("grid of ", voxels, " voxels"), "at most 2^33 are supported",
                         "use fewer, larger voxels");
  }
  if (!(grid.spacing_mm.minCoeff() > 0) || !grid.spacing_mm.allFinite() || !grid.origin_mm.allFinite()) {
    return invalid_input(concat("voxel spacing ", grid.spacing_mm.transpose(), " mm, origin ",
                                grid.origin_mm.transpose(), " mm"),
                         "spacing must be positive, both finite", "set --spacing-mm and --origin-mm");
  }
  return {};
}

float sample(const Volume& volume, const Eigen::Vector3d& world_mm) {
  const Grid& g = volume.grid;
  const Eigen::Vector3d p = (world_mm - g.origin_mm).cwiseQuotient(g.spacing_mm);
  const std::array<int, 3> size = {g.nx, g.ny, g.nz};
  std::array<int, 3> i0{}, i1{};
  std::array<double, 3> w{};
  for (std::size_t a = 0; a < 3; ++a) {
    const double v = p[static_cast<Eigen::Index>(a)];
    if (!(v >= -0.5) || !(v <= size[a] - 0.5)) return 0;
    const double f = std::floor(v);
    w[a] = v - f;
    i0[a] = std::clamp(static_cast<int>(f), 0, size[a] - 1);
    i1[a] = std::clamp(static_cast<int>(f) + 1, 0, size[a] - 1);
  }
  const auto lerp = [](double a, double b, double t) { return a + (b - a) * t; };
  const auto along_x = [&](int y, int z) {
    return lerp(volume.at(i0[0], y, z), volume.at(i1[0], y, z), w[0]);
  };
  const auto along_y = [&](int z) { return lerp(along_x(i0[1], z), along_x(i1[1], z), w[1]); };
  return static_cast<float>(lerp(along_y(i0[2]), along_y(i1[2]), w[2]));
}

}  // namespace flamefield
