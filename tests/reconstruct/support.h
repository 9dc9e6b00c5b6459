#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/random.h"
#include "reconstruct/ring.h"

namespace flamefield {

inline std::vector<float> random_values(std::size_t n, std::uint64_t seed) {
  Stream stream(seed, 0);
  std::vector<float> out(n);
  for (float& v : out) v = static_cast<float>(stream.uniform());
  return out;
}

inline double dot(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += static_cast<double>(a[i]) * b[i];
  return sum;
}

// Level pinholes around a domain.
inline Rig level_ring(const Grid& grid, int views, double spacing_rad = 0.39269908169872414) {
  return *make_ring(
      {.views = views, .spacing_rad = spacing_rad, .radius_mm = 6 * grid.nx * grid.spacing_mm.x()}, grid);
}

// The same cameras tilted, off centre and with a bent lens.
inline Rig crooked_ring(const Grid& grid, int views) {
  Rig rig = level_ring(grid, views);
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    Camera& c = rig.cameras[i];
    const double k = static_cast<double>(i + 1);
    const Eigen::Matrix3d tilt = (Eigen::AngleAxisd(0.02 * k, Eigen::Vector3d::UnitZ()) *
                                  Eigen::AngleAxisd(0.01 * k, Eigen::Vector3d::UnitX()))
                                     .toRotationMatrix();
    c.camera_from_world = Rigid3{tilt, Eigen::Vector3d(0.3, -0.2, 1) * k} * c.camera_from_world;
    c.distortion = {-4.0, 20.0, 0.01, -0.02, 0.0};  // strong: the images span only about 0.1 rad
    c.cx_px += 0.4;
    c.fy_px *= 1.03;
  }
  return rig;
}

}  // namespace flamefield
