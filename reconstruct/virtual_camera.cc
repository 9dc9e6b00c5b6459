#include "reconstruct/virtual_camera.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "proto/check.h"

namespace flamefield {

namespace {

// Beyond it the level image of a domain is stretched by more than 1 / cos^2 = 1.7 at its centre.
constexpr double kSteepest_rad = 40 * std::numbers::pi / 180;

Eigen::Vector3d centre_of(const Grid& domain) {
  return 0.5 * (domain.lower_mm() + domain.upper_mm());
}

double elevation_rad(const Eigen::Vector3d& direction) {
  return std::atan2(std::abs(direction.y()), std::hypot(direction.x(), direction.z()));
}

// Looks towards `target` with x horizontal; level: along the horizontal part only.
Rigid3 look_towards(const Eigen::Vector3d& eye, const Eigen::Vector3d& target, bool is_level) {
  Eigen::Vector3d z = target - eye;
  if (is_level) z.y() = 0;
  z.normalize();
  // Straight up or down has no horizontal right; any will do.
  const Eigen::Vector3d across = z.cross(Eigen::Vector3d::UnitY());
  const Eigen::Vector3d x = across.norm() > 1e-9 ? across.normalized() : Eigen::Vector3d::UnitX();
  Rigid3 camera_from_world;
  camera_from_world.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  camera_from_world.translation_mm = -(camera_from_world.rotation * eye);
  return camera_from_world;
}

// Width of a sensor pixel carried to the domain's centre.
double sensor_pixel_mm(const Camera& sensor, const Eigen::Vector3d& centre) {
  return (sensor.camera_from_world * centre).z() / std::sqrt(sensor.fx_px * sensor.fy_px);
}

// Range of x/z and y/z over the domain's corners; a pinhole keeps lines straight, so they bound it.
struct Extent {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(INFINITY), high = -low;
  bool is_in_front = true;
};

Extent extent_of(const Rigid3& camera_from_world, const Grid& domain) {
  const Eigen::Vector3d lower = domain.lower_mm(), upper = domain.upper_mm();
  Extent out;
  for (unsigned i = 0; i < 8; ++i) {
    const Eigen::Vector3d corner(i & 1 ? upper.x() : lower.x(), i & 2 ? upper.y() : lower.y(),
                                 i & 4 ? upper.z() : lower.z());
    const Eigen::Vector3d p = camera_from_world * corner;
    out.is_in_front = out.is_in_front && p.z() > 0;
    out.low = out.low.cwiseMin(p.head<2>() / p.z());
    out.high = out.high.cwiseMax(p.head<2>() / p.z());
  }
  return out;
}

}  // namespace

Result<VirtualCameras> virtual_cameras(const std::vector<Camera>& sensors, const Grid& domain, int binning,
                                       double margin_px) {
  expect(!sensors.empty(), "there is a camera");
  const Eigen::Vector3d centre = centre_of(domain);
  VirtualCameras out;
  double coarsest_mm = 0, mean_mm = 0;
  for (const Camera& sensor : sensors) {
    const double pixel_mm = sensor_pixel_mm(sensor, centre);
    coarsest_mm = std::max(coarsest_mm, pixel_mm);
    mean_mm += pixel_mm / static_cast<double>(sensors.size());
  }
  out.pixel_mm = binning > 0 ? binning * mean_mm : std::max(domain.spacing_mm.mean(), coarsest_mm);
  out.sensor_px_per_pixel = out.pixel_mm / mean_mm;

  Eigen::Vector2d size_px(0, 0);
  std::vector<Extent> extents;
  for (const Camera& sensor : sensors) {
    const Eigen::Vector3d eye = sensor.centre_mm(), sight = centre - eye;
    const bool is_level = elevation_rad(sight) <= kSteepest_rad;
    if (!is_level) out.not_level.push_back(sensor.name);
    Camera camera;
    camera.name = sensor.name;
    camera.camera_from_world = look_towards(eye, centre, is_level);
    const Extent extent = extent_of(camera.camera_from_world, domain);
    if (!extent.is_in_front || !(sensor_pixel_mm(sensor, centre) > 0)) {
      return invalid_input(concat("camera ", sensor.name, " at ", eye.transpose(), " mm"),
                           "the reconstruction domain is not wholly in front of it",
                           "check the rig, the domain's size and its origin");
    }
    camera.fx_px = camera.fy_px = (camera.camera_from_world * centre).z() / out.pixel_mm;
    size_px = size_px.cwiseMax(camera.fx_px * (extent.high - extent.low));
    out.largest_turn_rad =
        std::max(out.largest_turn_rad,
                 rotation_angle_rad(sensor.camera_from_world * camera.camera_from_world.inverse()));
    extents.push_back(extent);
    out.cameras.push_back(camera);
  }
  const double margin = 2 * margin_px / out.sensor_px_per_pixel;
  for (std::size_t i = 0; i < out.cameras.size(); ++i) {
    Camera& camera = out.cameras[i];
    // Rounding up a size that is whole but for the last digits must not add a pixel.
    camera.image_width_px = static_cast<int>(std::ceil(std::min(size_px.x() + margin, 1e5) - 1e-6));
    camera.image_height_px = static_cast<int>(std::ceil(std::min(size_px.y() + margin, 1e5) - 1e-6));
    const Eigen::Vector2d middle = 0.5 * (extents[i].low + extents[i].high);
    camera.cx_px = 0.5 * (camera.image_width_px - 1) - camera.fx_px * middle.x();
    camera.cy_px = 0.5 * (camera.image_height_px - 1) - camera.fy_px * middle.y();
  }
  return out;
}

}  // namespace flamefield
