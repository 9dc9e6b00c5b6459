#include "services/report/slices.h"

#include <algorithm>

#include "proto/check.h"

namespace flamefield {
namespace {

Eigen::Index number(Axis axis) {
  return static_cast<Eigen::Index>(axis);
}

}  // namespace

int layers(const Grid& grid, Axis normal) {
  return std::array<int, 3>{grid.nx, grid.ny, grid.nz}[static_cast<std::size_t>(normal)];
}

std::string_view label_of(Axis axis) {
  switch (axis) {
    case Axis::X:
      return "x";
    case Axis::Y:
      return "HAB y";
    case Axis::Z:
      return "z";
  }
  return "";
}

Slice slice(const Volume& volume, Axis normal, int index) {
  const Grid& g = volume.grid;
  expect(volume.values.size() == g.voxels(), "a volume has one value per voxel");
  expect(index >= 0 && index < layers(g, normal), "the slice lies in the volume");
  Slice out;
  out.normal = normal;
  out.position_mm = g.origin_mm[number(normal)] + g.spacing_mm[number(normal)] * index;
  out.right = normal == Axis::X ? Axis::Z : Axis::X;
  out.up = normal == Axis::Y ? Axis::Z : Axis::Y;
  out.right_mm = {g.lower_mm()[number(out.right)], g.upper_mm()[number(out.right)]};
  out.up_mm = {g.lower_mm()[number(out.up)], g.upper_mm()[number(out.up)]};
  out.image = Image(layers(g, out.right), layers(g, out.up));
  for (int row = 0; row < out.image.height_px; ++row) {
    const int up = out.image.height_px - 1 - row;
    for (int right = 0; right < out.image.width_px; ++right) {
      std::array<int, 3> v{};
      v[static_cast<std::size_t>(normal)] = index;
      v[static_cast<std::size_t>(out.right)] = right;
      v[static_cast<std::size_t>(out.up)] = up;
      out.image.at(right, row) = volume.at(v[0], v[1], v[2]);
    }
  }
  return out;
}

std::vector<double> mean_by_height(const Volume& volume) {
  const Grid& g = volume.grid;
  std::vector<double> mean(static_cast<std::size_t>(g.ny));
  for (int z = 0; z < g.nz; ++z) {
    for (int y = 0; y < g.ny; ++y) {
      double sum = 0;
      for (int x = 0; x < g.nx; ++x) sum += static_cast<double>(volume.at(x, y, z));
      mean[static_cast<std::size_t>(y)] += sum / g.nx / g.nz;
    }
  }
  return mean;
}

Volume reduced(const Volume& volume, int max_side) {
  const Grid& g = volume.grid;
  const int block = (std::max({g.nx, g.ny, g.nz}) + max_side - 1) / max_side;
  if (block <= 1) return volume;
  const auto count = [&](int n) { return std::max(1, n / block); };
  const auto width = [&](int n) { return std::min(block, n); };
  Grid coarse = g;
  coarse.nx = count(g.nx), coarse.ny = count(g.ny), coarse.nz = count(g.nz);
  const Eigen::Vector3d merged(width(g.nx), width(g.ny), width(g.nz));
  coarse.spacing_mm = g.spacing_mm.cwiseProduct(merged);
  coarse.origin_mm = g.lower_mm() + 0.5 * coarse.spacing_mm;
  Volume out(coarse);
  const float scale = static_cast<float>(1 / merged.prod());
  for (int z = 0; z < coarse.nz * width(g.nz); ++z) {
    for (int y = 0; y < coarse.ny * width(g.ny); ++y) {
      for (int x = 0; x < coarse.nx * width(g.nx); ++x) {
        out.at(x / width(g.nx), y / width(g.ny), z / width(g.nz)) += scale * volume.at(x, y, z);
      }
    }
  }
  return out;
}

}  // namespace flamefield
