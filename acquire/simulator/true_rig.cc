#include "acquire/simulator/true_rig.h"

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "proto/board.h"
#include "proto/camera_name.h"
#include "proto/check.h"

namespace flamefield {

namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180;

// x right, y down, z forward, without roll about the line of sight.
Rigid3 look_at(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  const Eigen::Vector3d z = (target - eye).normalized();
  const Eigen::Vector3d x = z.cross(Eigen::Vector3d::UnitY()).normalized();
  Rigid3 camera_from_world;
  camera_from_world.rotation << x.transpose(), z.cross(x).transpose(), z.transpose();
  camera_from_world.translation_mm = -(camera_from_world.rotation * eye);
  return camera_from_world;
}

}  // namespace

Rig ring_with_tolerances(const TrueRigOptions& options) {
  expect(options.cameras >= 1 && options.tolerance >= 0, "a ring has cameras and no negative tolerance");
  std::mt19937_64 engine(options.seed);
  std::normal_distribution<double> normal;
  const auto off = [&](double sigma) { return options.tolerance * sigma * normal(engine); };

  Rig rig;
  for (int k = 0; k < options.cameras; ++k) {
    const double phi = k * options.spacing_rad + off(0.5 * kRadPerDeg);
    const double radius = options.radius_mm + off(5);
    const double height = options.height_mm + off(5);
    const double aim_x = off(4), aim_y = off(4), aim_z = off(4);
    const Eigen::Vector3d eye(radius * std::cos(phi), height, radius * std::sin(phi));
    const Rigid3 level = look_at(eye, {aim_x, options.height_mm + aim_y, aim_z});
    const Rigid3 roll{Eigen::AngleAxisd(off(1 * kRadPerDeg), Eigen::Vector3d::UnitZ()).toRotationMatrix(),
                      Eigen::Vector3d::Zero()};
    Camera camera;
    camera.name = camera_name(static_cast<std::size_t>(k));
    camera.image_width_px = options.image_width_px;
    camera.image_height_px = options.image_height_px;
    camera.fx_px = camera.fy_px = options.focal_px * (1 + off(0.005));
    camera.cx_px = 0.5 * (options.image_width_px - 1) + off(3);
    camera.cy_px = 0.5 * (options.image_height_px - 1) + off(3);
    camera.distortion[0] = options.tolerance > 0 ? -0.05 + off(0.02) : 0;
    camera.camera_from_world = roll * level;
    rig.cameras.push_back(camera);
  }
  return rig;
}

std::vector<Rigid3> board_poses(const BoardPosesOptions& options) {
  expect(options.count >= 1, "a session has at least one board pose");
  std::mt19937_64 engine(options.seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  const double first = options.first_azimuth_rad, last = options.last_azimuth_rad;

  std::vector<Rigid3> poses = {upright_board(options.centre_mm, 0.5 * (first + last))};
  const int by_hand = options.count - 1;
  for (int k = 0; k < by_hand; ++k) {
    const double share = by_hand > 1 ? static_cast<double>(k) / (by_hand - 1) : 0.5;
    const double azimuth = first + share * (last - first) + 0.05 * uniform(engine);
    Eigen::Vector3d centre = options.centre_mm;
    for (double& c : centre) c += options.offset_mm * uniform(engine);
    const Eigen::AngleAxisd tilt_x(options.tilt_rad * uniform(engine), Eigen::Vector3d::UnitX());
    const Eigen::AngleAxisd tilt_y(options.tilt_rad * uniform(engine), Eigen::Vector3d::UnitY());
    const Eigen::AngleAxisd roll(options.roll_rad * uniform(engine), Eigen::Vector3d::UnitZ());
    const Rigid3 hand{(tilt_x * tilt_y * roll).toRotationMatrix(), Eigen::Vector3d::Zero()};
    poses.push_back(upright_board(centre, azimuth) * hand);
  }
  return poses;
}

}  // namespace flamefield
