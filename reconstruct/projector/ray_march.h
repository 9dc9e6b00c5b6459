#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "proto/camera.h"
#include "proto/volume.h"

namespace flamefield {

// The one discretisation of a line of sight (paper Eq. 1), shared by renderer and projector: the part of the
// ray inside the box of the voxels' outer faces, cut into equal steps that are sampled at their middles.
// Coordinates are in voxels: (0, 0, 0) is the centre of the first voxel.
struct MarchedRay {
  std::array<float, 3> first = {};    // the first sample
  std::array<float, 3> advance = {};  // from sample to sample
  int samples = 0;                    // 0: the ray misses the box
  float step_mm = 0;                  // ds

  float at(std::size_t axis, int sample) const {
    return first[axis] + static_cast<float>(sample) * advance[axis];
  }
};

inline MarchedRay march(const Grid& grid, const Ray& ray, double longest_step_mm) {
  const Eigen::Vector3d lower = grid.lower_mm(), upper = grid.upper_mm();
  double enter = 0, leave = std::numeric_limits<double>::infinity();
  for (int a = 0; a < 3; ++a) {
    if (ray.direction[a] == 0) {
      if (ray.origin_mm[a] < lower[a] || ray.origin_mm[a] > upper[a]) return {};
      continue;
    }
    const double t0 = (lower[a] - ray.origin_mm[a]) / ray.direction[a];
    const double t1 = (upper[a] - ray.origin_mm[a]) / ray.direction[a];
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  if (!(leave > enter)) return {};
  MarchedRay out;
  out.samples = std::max(1, static_cast<int>(std::ceil((leave - enter) / longest_step_mm - 1e-9)));
  const double step_mm = (leave - enter) / out.samples;
  out.step_mm = static_cast<float>(step_mm);
  const Eigen::Vector3d first = (ray.origin_mm + (enter + 0.5 * step_mm) * ray.direction - grid.origin_mm)
                                    .cwiseQuotient(grid.spacing_mm);
  const Eigen::Vector3d advance = (step_mm * ray.direction).cwiseQuotient(grid.spacing_mm);
  for (std::size_t a = 0; a < 3; ++a) {
    out.first[a] = static_cast<float>(first[static_cast<Eigen::Index>(a)]);
    out.advance[a] = static_cast<float>(advance[static_cast<Eigen::Index>(a)]);
  }
  return out;
}

// Between which two voxels of an axis a coordinate lies. Beyond the outermost centres the nearest counts.
struct Cell {
  int lower = 0;
  float weight = 0;  // of the upper neighbour
};

inline Cell cell_at(float coordinate, int size) {
  const float inside = std::clamp(coordinate, 0.0f, static_cast<float>(size - 1));
  const int lower = std::min(static_cast<int>(inside), std::max(size - 2, 0));
  return {lower, inside - static_cast<float>(lower)};
}

// A thin lens: the finite aperture of the paper's "advanced camera model". Points in focus look as through a
// pinhole.
struct Lens {
  double aperture_mm = 0;  // diameter of the entrance pupil; 0: pinhole
  double focus_mm = 0;     // distance of the plane in focus along the optical axis
};

// Rays through the sub-pixels of a camera, and through points spread over its aperture.
class PixelRays {
 public:
  PixelRays(const Camera& camera, int pixel_samples, const Lens& lens = {})
      : camera_(camera),
        lens_(lens),
        centre_mm_(camera.centre_mm()),
        world_from_camera_(camera.camera_from_world.rotation.transpose()),
        samples_(pixel_samples),
        aperture_points_(lens.aperture_mm > 0 ? kAperturePoints : 1) {}

  int per_pixel() const { return samples_ * samples_ * aperture_points_; }

  Ray ray(int x_px, int y_px, int sub) const {
    const auto offset = [&](int i) { return (i + 0.5) / samples_ - 0.5; };
    const int point = sub / (samples_ * samples_);
    const Eigen::Vector2d pixel(x_px + offset(sub % samples_), y_px + offset(sub / samples_ % samples_));
    const Eigen::Vector2d n = normalised_from_pixel(camera_, pixel);
    const Eigen::Vector3d through(n.x(), n.y(), 1);
    if (aperture_points_ == 1) return {centre_mm_, (world_from_camera_ * through).normalized()};
    // Sunflower points on the disc, of equal area each; all rays of a pixel meet in the plane in focus.
    const double r = 0.5 * lens_.aperture_mm * std::sqrt((point + 0.5) / aperture_points_),
                 turn = 2.399963 * point;
    const Eigen::Vector3d from(r * std::cos(turn), r * std::sin(turn), 0);
    return {centre_mm_ + world_from_camera_ * from,
            (world_from_camera_ * (lens_.focus_mm * through - from)).normalized()};
  }

 private:
  static constexpr int kAperturePoints = 24;
  const Camera& camera_;
  Lens lens_;
  Eigen::Vector3d centre_mm_;
  Eigen::Matrix3d world_from_camera_;
  int samples_, aperture_points_;
};

inline double longest_step_mm(const Grid& grid, double step_voxels) {
  return step_voxels * grid.spacing_mm.minCoeff();
}

}  // namespace flamefield
