#include <algorithm>
#include <cmath>
#include <vector>

#include "reconstruct/phantom/flame.h"

// The canonical bodies of the paper's parameter study (Section 3.1), in units of the shortest side of the
// box, centred in it.
namespace flamefield {

namespace {

constexpr int kSamples = 5;  // per axis of a cell

// Offsets of the samples from a cell's middle, in cells.
double sample_offset(int sample) {
  return (sample + 0.5) / kSamples - 0.5;
}

// A body filled with 1, given the distance to its surface (negative inside). Only cells that the surface can
// cross are sampled: a distance changes by no more than the way.
template <class Distance>
Volume filled_body(const Grid& grid, const Distance& distance) {
  const Eigen::Vector3d centre = 0.5 * (grid.lower_mm() + grid.upper_mm());
  const double side = (grid.upper_mm() - grid.lower_mm()).minCoeff();
  const double reach = 0.5 * grid.spacing_mm.norm() / side;
  Volume out(grid);
  const auto cell_average = [&](const Eigen::Vector3d& middle) {
    int inside = 0;
    for (int s = 0; s < kSamples * kSamples * kSamples; ++s) {
      const Eigen::Vector3d offset(sample_offset(s % kSamples), sample_offset(s / kSamples % kSamples),
                                   sample_offset(s / kSamples / kSamples));
      inside += distance(Eigen::Vector3d(middle + grid.spacing_mm.cwiseProduct(offset) / side)) < 0;
    }
    return static_cast<float>(inside) / static_cast<float>(kSamples * kSamples * kSamples);
  };
  for (int z = 0; z < grid.nz; ++z)
    for (int y = 0; y < grid.ny; ++y)
      for (int x = 0; x < grid.nx; ++x) {
        const Eigen::Vector3d middle = (grid.voxel_centre_mm(x, y, z) - centre) / side;
        const double d = distance(middle);
        out.at(x, y, z) = d > reach ? 0.0f : d < -reach ? 1.0f : cell_average(middle);
      }
  return out;
}

}  // namespace

Volume make_torus(const Grid& grid) {
  constexpr double kRing = 0.27, kTube = 0.11;
  return filled_body(grid, [](const Eigen::Vector3d& p) {
    return std::hypot(std::hypot(p.x(), p.z()) - kRing, p.y()) - kTube;
  });
}

Volume make_hollow_sphere(const Grid& grid) {
  constexpr double kInner = 0.22, kOuter = 0.35;
  return filled_body(grid, [](const Eigen::Vector3d& p) {
    const double r = p.norm();
    return std::max(kInner - r, r - kOuter);
  });
}

// exp(-r^2) is a product over the axes, and so is its average over a cell.
Volume make_gaussian(const Grid& grid) {
  constexpr double kSigma = 0.13;
  const Eigen::Vector3d centre = 0.5 * (grid.lower_mm() + grid.upper_mm());
  const double side = (grid.upper_mm() - grid.lower_mm()).minCoeff();
  const auto averages_along = [&](Eigen::Index axis, int cells) {
    std::vector<double> out(static_cast<std::size_t>(cells), 0.0);
    for (int i = 0; i < cells; ++i)
      for (int s = 0; s < kSamples; ++s) {
        const double at_mm = grid.origin_mm[axis] + (i + sample_offset(s)) * grid.spacing_mm[axis];
        const double p = (at_mm - centre[axis]) / side;
        out[static_cast<std::size_t>(i)] += std::exp(-p * p / (2 * kSigma * kSigma)) / kSamples;
      }
    return out;
  };
  const auto x = averages_along(0, grid.nx), y = averages_along(1, grid.ny), z = averages_along(2, grid.nz);
  Volume out(grid);
  std::size_t i = 0;
  for (double at_z : z)
    for (double at_y : y)
      for (double at_x : x) out.values[i++] = static_cast<float>(at_x * at_y * at_z);
  return out;
}

}  // namespace flamefield
