#include <algorithm>
#include <array>
#include <cmath>

#include "proto/check.h"
#include "reconstruct/metrics.h"
#include "reconstruct/parallel.h"

namespace flamefield {

namespace {

// Integral from the lower face of the box to u of voxel j's weight in the trilinear field: a hat, continued
// flat from the outermost centres to the faces.
double integral_of_hat(double u, int j, int voxels) {
  const double d = std::clamp(u, -0.5, voxels - 0.5) - j;
  const double rising = j == 0 ? 0.5 + std::min(d, 0.0) : 0.5 * std::pow(std::clamp(d + 1, 0.0, 1.0), 2);
  const double falling =
      j == voxels - 1 ? std::max(d, 0.0) : 0.5 - 0.5 * std::pow(1 - std::clamp(d, 0.0, 1.0), 2);
  return rising + falling;
}

struct Weights {
  int first = 0;              // source voxel
  std::vector<double> value;  // of it and those after it
};

// The mean over target cell t is a weighted sum of source voxels, axis by axis.
std::vector<Weights> weights_along(const Grid& from, const Grid& to, int from_voxels, int to_voxels,
                                   Eigen::Index axis) {
  std::vector<Weights> out(static_cast<std::size_t>(to_voxels));
  const double ratio = to.spacing_mm[axis] / from.spacing_mm[axis];
  const double start = (to.lower_mm()[axis] - from.origin_mm[axis]) / from.spacing_mm[axis];
  for (int t = 0; t < to_voxels; ++t) {
    const double low = start + t * ratio, high = low + ratio;
    Weights& w = out[static_cast<std::size_t>(t)];
    w.first = static_cast<int>(std::clamp(std::floor(low - 1), 0.0, from_voxels - 1.0));
    const int last = static_cast<int>(std::clamp(std::ceil(high + 1), 0.0, from_voxels - 1.0));
    for (int j = w.first; j <= last; ++j) {
      w.value.push_back((integral_of_hat(high, j, from_voxels) - integral_of_hat(low, j, from_voxels)) /
                        ratio);
    }
  }
  return out;
}

// values (outer, n, inner) -> (outer, weights, inner)
std::vector<float> apply(const std::vector<float>& values, const std::vector<Weights>& weights,
                         std::size_t outer, std::size_t n, std::size_t inner, Team& team) {
  std::vector<float> out(outer * weights.size() * inner);
  team.run(outer, [&](std::size_t o) {
    std::vector<double> sum(inner);
    for (std::size_t t = 0; t < weights.size(); ++t) {
      std::ranges::fill(sum, 0.0);
      for (std::size_t j = 0; j < weights[t].value.size(); ++j) {
        const double w = weights[t].value[j];
        const float* in = &values[(o * n + static_cast<std::size_t>(weights[t].first) + j) * inner];
        if (w != 0) {
          for (std::size_t i = 0; i < inner; ++i) sum[i] += w * in[i];
        }
      }
      for (std::size_t i = 0; i < inner; ++i)
        out[(o * weights.size() + t) * inner + i] = static_cast<float>(sum[i]);
    }
  });
  return out;
}

}  // namespace

Volume resample(const Volume& volume, const Grid& grid) {
  expect(volume.values.size() == volume.grid.voxels(), "the volume has a value for every voxel");
  if (volume.grid == grid) return volume;  // averaging would smooth what is already there
  const Grid& from = volume.grid;
  const auto count = [](int n) { return static_cast<std::size_t>(n); };
  Team team;
  Volume out;
  out.grid = grid;
  // z first: the other axes then have less to do when the target is coarser.
  auto values = apply(volume.values, weights_along(from, grid, from.nz, grid.nz, 2), 1, count(from.nz),
                      count(from.ny) * count(from.nx), team);
  values = apply(values, weights_along(from, grid, from.ny, grid.ny, 1), count(grid.nz), count(from.ny),
                 count(from.nx), team);
  out.values = apply(values, weights_along(from, grid, from.nx, grid.nx, 0), count(grid.nz) * count(grid.ny),
                     count(from.nx), 1, team);
  return out;
}

}  // namespace flamefield
