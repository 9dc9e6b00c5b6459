#include "reconstruct/evolutionary/ladder.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

Grid halved(const Grid& grid) {
  Grid out = grid;
  out.nx = (grid.nx + 1) / 2;
  out.ny = (grid.ny + 1) / 2;
  out.nz = (grid.nz + 1) / 2;
  out.spacing_mm = 2 * grid.spacing_mm;
  out.origin_mm = grid.lower_mm() + grid.spacing_mm;
  return out;
}

Interpolation::Interpolation(const Grid& fine)
    : fine_(fine),
      coarse_(halved(fine)),
      shares_{axis(fine.nx, coarse_.nx), axis(fine.ny, coarse_.ny), axis(fine.nz, coarse_.nz)} {}

Interpolation::Axis Interpolation::axis(int fine, int coarse) {
  Axis out(static_cast<std::size_t>(coarse));
  for (int i = 0; i < fine; ++i) {
    const double at = (i + 0.5) / 2 - 0.5;
    const int below = static_cast<int>(std::floor(at));
    const int a = std::clamp(below, 0, coarse - 1), b = std::clamp(below + 1, 0, coarse - 1);
    const auto share = static_cast<float>(at - below);
    if (a == b) {
      out[static_cast<std::size_t>(a)].push_back({i, 1});
      continue;
    }
    out[static_cast<std::size_t>(a)].push_back({i, 1 - share});
    out[static_cast<std::size_t>(b)].push_back({i, share});
  }
  return out;
}

std::vector<float> Interpolation::prolong(std::span<const float> coarse) const {
  std::vector<float> out(fine_.voxels(), 0);
  for (std::size_t voxel = 0; voxel < coarse.size(); ++voxel) {
    if (coarse[voxel] == 0) continue;
    visit(voxel, [&](std::size_t j, float share) { out[j] += share * coarse[voxel]; });
  }
  for (float& v : out) v = std::min(v, 1.0f);  // shares add up to 1, but for rounding
  return out;
}

std::vector<float> Interpolation::largest_within(std::span<const float> fine) const {
  std::vector<float> out(coarse_.voxels(), 0);
  for (int z = 0; z < fine_.nz; ++z)
    for (int y = 0; y < fine_.ny; ++y)
      for (int x = 0; x < fine_.nx; ++x) {
        float& largest = out[coarse_.index(x / 2, y / 2, z / 2)];
        largest = std::max(largest, fine[fine_.index(x, y, z)]);
      }
  return out;
}

}  // namespace flamefield
