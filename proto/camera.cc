#include "proto/camera.h"

#include <algorithm>
#include <cmath>

#include "proto/check.h"

namespace flamefield {

double rotation_angle_rad(const Rigid3& motion) {
  // atan2 of sine and cosine stays accurate near 0, where acos alone loses half the digits.
  const Eigen::Matrix3d& r = motion.rotation;
  const Eigen::Vector3d axis(r(2, 1) - r(1, 2), r(0, 2) - r(2, 0), r(1, 0) - r(0, 1));
  return std::atan2(0.5 * axis.norm(), 0.5 * (r.trace() - 1.0));
}

bool Camera::is_distorted() const {
  return std::ranges::any_of(distortion, [](double k) { return k != 0.0; });
}

Result<> validate(const Camera& camera) {
  const std::string who = "camera " + (camera.name.empty() ? std::string("<unnamed>") : camera.name);
  if (camera.image_width_px <= 0 || camera.image_height_px <= 0) {
    return invalid_input(
        concat(who, ": image size ", camera.image_width_px, "x", camera.image_height_px, " px"),
        "both must be positive", "set image_width and image_height");
  }
  if (!(camera.fx_px > 0) || !(camera.fy_px > 0) || !std::isfinite(camera.fx_px + camera.fy_px)) {
    return invalid_input(concat(who, ": focal lengths ", camera.fx_px, ", ", camera.fy_px, " px"),
                         "must be positive and finite", "check camera_matrix");
  }
  double sum = camera.cx_px + camera.cy_px + camera.camera_from_world.rotation.sum() +
               camera.camera_from_world.translation_mm.sum();
  for (double k : camera.distortion) sum += k;
  if (!std::isfinite(sum)) {
    return invalid_input(who + ": not a number among its parameters", "all must be finite",
                         "calibrate this camera again");
  }
  const Eigen::Matrix3d& r = camera.camera_from_world.rotation;
  if ((r * r.transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-6 || r.determinant() < 0) {
    return invalid_input(who + ": camera_from_world has no proper rotation",
                         "R must be orthonormal with determinant +1", "check the rows of the 3x4 matrix");
  }
  return {};
}

namespace {

// OpenCV's model: radial 1 + k1 r^2 + k2 r^4 + k3 r^6, tangential p1, p2.
Eigen::Vector2d distort(const std::array<double, 5>& d, const Eigen::Vector2d& p) {
  const double x = p.x(), y = p.y(), r2 = x * x + y * y;
  const double radial = 1 + r2 * (d[0] + r2 * (d[1] + r2 * d[4]));
  return {x * radial + 2 * d[2] * x * y + d[3] * (r2 + 2 * x * x),
          y * radial + d[2] * (r2 + 2 * y * y) + 2 * d[3] * x * y};
}

}  // namespace

Eigen::Vector2d pixel_from_normalised(const Camera& camera, const Eigen::Vector2d& normalised) {
  const Eigen::Vector2d p = camera.is_distorted() ? distort(camera.distortion, normalised) : normalised;
  return {camera.fx_px * p.x() + camera.cx_px, camera.fy_px * p.y() + camera.cy_px};
}

Eigen::Vector2d normalised_from_pixel(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d target((pixel.x() - camera.cx_px) / camera.fx_px,
                               (pixel.y() - camera.cy_px) / camera.fy_px);
  if (!camera.is_distorted()) return target;
  Eigen::Vector2d p = target;
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector2d step = target - distort(camera.distortion, p);
    p += step;
    if (step.squaredNorm() < 1e-24) break;
  }
  return p;
}

std::optional<Eigen::Vector2d> project(const Camera& camera, const Eigen::Vector3d& world_mm) {
  const Eigen::Vector3d p = camera.camera_from_world * world_mm;
  if (!(p.z() > 0)) return std::nullopt;
  return pixel_from_normalised(camera, p.head<2>() / p.z());
}

Ray pixel_ray(const Camera& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d n = normalised_from_pixel(camera, pixel);
  const Eigen::Vector3d in_camera(n.x(), n.y(), 1.0);
  return {camera.centre_mm(), (camera.camera_from_world.rotation.transpose() * in_camera).normalized()};
}

Camera cropped_and_binned(const Camera& camera, int x0_px, int y0_px, int width_px, int height_px,
                          int binning) {
  expect(binning >= 1 && width_px >= binning && height_px >= binning, "binning must fit into the region");
  Camera out = camera;
  const double b = binning;
  out.image_width_px = width_px / binning;
  out.image_height_px = height_px / binning;
  out.fx_px = camera.fx_px / b;
  out.fy_px = camera.fy_px / b;
  // The centre of merged pixel 0 lies (b - 1) / 2 original pixels right of the region's first centre.
  out.cx_px = (camera.cx_px - x0_px - (b - 1) / 2) / b;
  out.cy_px = (camera.cy_px - y0_px - (b - 1) / 2) / b;
  return out;
}

}  // namespace flamefield
