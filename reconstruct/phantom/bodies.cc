#include <algorithm>
#include <cmath>

#include "reconstruct/phantom/flame.h"

// The canonical bodies of the paper's parameter study (Section 3.1), in units of the shortest side of the
// box, centred in it.
namespace flamefield {

namespace {

template <class Field>
Volume cell_averages(const Grid& grid, const Field& field) {
  constexpr int kSamples = 5;  // per axis
  const Eigen::Vector3d centre = 0.5 * (grid.lower_mm() + grid.upper_mm());
  const double side = (grid.upper_mm() - grid.lower_mm()).minCoeff();
  Volume out(grid);
  for (int z = 0; z < grid.nz; ++z)
    for (int y = 0; y < grid.ny; ++y)
      for (int x = 0; x < grid.nx; ++x) {
        double sum = 0;
        for (int s = 0; s < kSamples * kSamples * kSamples; ++s) {
          const Eigen::Vector3d sub =
              (Eigen::Vector3d(s % kSamples, s / kSamples % kSamples, s / kSamples / kSamples).array() +
               0.5) /
                  kSamples -
              0.5;
          const Eigen::Vector3d p = grid.voxel_centre_mm(x, y, z) + grid.spacing_mm.cwiseProduct(sub);
          sum += field(Eigen::Vector3d((p - centre) / side));
        }
        out.at(x, y, z) = static_cast<float>(sum / (kSamples * kSamples * kSamples));
      }
  return out;
}

}  // namespace

Volume make_torus(const Grid& grid) {
  constexpr double kRing = 0.27, kTube = 0.11;
  return cell_averages(grid, [](const Eigen::Vector3d& p) {
    const double off = std::hypot(p.x(), p.z()) - kRing;
    return off * off + p.y() * p.y() < kTube * kTube ? 1.0 : 0.0;
  });
}

Volume make_hollow_sphere(const Grid& grid) {
  constexpr double kInner = 0.22, kOuter = 0.35;
  return cell_averages(grid, [](const Eigen::Vector3d& p) {
    const double r = p.norm();
    return r > kInner && r < kOuter ? 1.0 : 0.0;
  });
}

Volume make_gaussian(const Grid& grid) {
  constexpr double kSigma = 0.13;
  return cell_averages(
      grid, [](const Eigen::Vector3d& p) { return std::exp(-p.squaredNorm() / (2 * kSigma * kSigma)); });
}

}  // namespace flamefield
