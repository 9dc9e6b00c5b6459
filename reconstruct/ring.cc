#include "reconstruct/ring.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "proto/camera_name.h"
#include "proto/error.h"

namespace flamefield {

namespace {

Result<> check(const RingOptions& o, double half_diagonal_mm) {
  if (o.views < 1) {
    return invalid_input(concat("views=", o.views), "must be positive", "set --views to at least 1");
  }
  if (!(o.radius_mm > half_diagonal_mm) || !std::isfinite(o.radius_mm)) {
    return invalid_input(
        concat("radius_mm=", o.radius_mm),
        concat("cameras must stand outside the domain, whose half diagonal is ", half_diagonal_mm, " mm"),
        "set a larger --radius-mm");
  }
  if (!std::isfinite(o.spacing_rad) || !(std::abs(o.elevation_rad) < std::numbers::pi / 2)) {
    return invalid_input(concat("spacing ", o.spacing_rad, " rad, elevation ", o.elevation_rad, " rad"),
                         "elevation must be between -90 and 90 degrees, both finite",
                         "check --spacing-deg and --elevation-deg");
  }
  if (o.image_width_px < 0 || o.image_height_px < 0) {
    return invalid_input(concat("image size ", o.image_width_px, "x", o.image_height_px, " px"),
                         "must be positive", "set --image W,H");
  }
  return {};
}

}  // namespace

Result<Rig> make_ring(const RingOptions& options, const Grid& domain) {
  if (auto ok = validate(domain); !ok) return tl::unexpected(ok.error());
  const Eigen::Vector3d size = domain.upper_mm() - domain.lower_mm();
  const Eigen::Vector3d centre = 0.5 * (domain.upper_mm() + domain.lower_mm());
  if (auto ok = check(options, 0.5 * size.norm()); !ok) return tl::unexpected(ok.error());

  const int width = options.image_width_px > 0 ? options.image_width_px : domain.nx;
  const int height = options.image_height_px > 0 ? options.image_height_px : domain.ny;
  // Paper, Fig. 2: the image plane lies on the box's face, at R - NZ/2, and the view covers that face.
  const double side = std::max(size.x(), size.z()), to_face = options.radius_mm - 0.5 * side;
  const double focal_px = std::min(width * to_face / side, height * to_face / size.y());

  Rig rig;
  for (int k = 0; k < options.views; ++k) {
    const double phi = k * options.spacing_rad, up = std::sin(options.elevation_rad),
                 out = std::cos(options.elevation_rad);
    const Eigen::Vector3d outward(out * std::cos(phi), up, out * std::sin(phi));
    Camera camera;
    camera.name = camera_name(static_cast<std::size_t>(k));
    camera.image_width_px = width;
    camera.image_height_px = height;
    camera.fx_px = camera.fy_px = focal_px;
    camera.cx_px = 0.5 * (width - 1);
    camera.cy_px = 0.5 * (height - 1);
    const Eigen::Vector3d forward = -outward;
    const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitY()).normalized();
    Eigen::Matrix3d& rotation = camera.camera_from_world.rotation;
    rotation.row(0) = right;
    rotation.row(1) = forward.cross(right);
    rotation.row(2) = forward;
    camera.camera_from_world.translation_mm = -rotation * (centre + options.radius_mm * outward);
    rig.cameras.push_back(camera);
  }
  return rig;
}

}  // namespace flamefield
