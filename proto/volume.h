#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// A box of voxels. x runs fastest, so the values have shape (nz, ny, nx); +y is height above burner (HAB).
struct Grid {
  int nx = 0, ny = 0, nz = 0;
  Eigen::Vector3d spacing_mm = Eigen::Vector3d::Ones();
  Eigen::Vector3d origin_mm = Eigen::Vector3d::Zero();  // centre of voxel (0, 0, 0)

  std::size_t voxels() const {
    return static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny) * static_cast<std::size_t>(nz);
  }
  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(ny) + static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nx) +
           static_cast<std::size_t>(x);
  }
  Eigen::Vector3d voxel_centre_mm(int x, int y, int z) const {
    return origin_mm + spacing_mm.cwiseProduct(Eigen::Vector3d(x, y, z));
  }
  // Outer faces of the box.
  Eigen::Vector3d lower_mm() const { return origin_mm - 0.5 * spacing_mm; }
  Eigen::Vector3d upper_mm() const {
    return lower_mm() + spacing_mm.cwiseProduct(Eigen::Vector3d(nx, ny, nz));
  }
  bool operator==(const Grid&) const = default;
};

// A grid whose centre is the world origin.
Grid centred_grid(int nx, int ny, int nz, double spacing_mm);

// Sizes and spacings positive and finite, at most 2^33 voxels.
Result<> validate(const Grid& grid);

// A scalar field on a grid, e.g. the flame's emission.
struct Volume {
  Grid grid;
  std::vector<float> values;  // (nz, ny, nx)

  Volume() = default;
  explicit Volume(const Grid& g, float value = 0) : grid(g), values(g.voxels(), value) {}
  float& at(int x, int y, int z) { return values[grid.index(x, y, z)]; }
  float at(int x, int y, int z) const { return values[grid.index(x, y, z)]; }
};

// Trilinear between voxel centres; beyond the outermost centres the nearest one counts, outside the box zero.
float sample(const Volume& volume, const Eigen::Vector3d& world_mm);

}  // namespace flamefield
