#pragma once

#include <Eigen/Core>
#include <Eigen/LU>

namespace flamefield {

// A rigid motion. Named so that frames cancel inward:
//   camera_from_board = camera_from_world * world_from_board
struct Rigid3 {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator*(const Eigen::Vector3d& point_mm) const {
    return rotation * point_mm + translation_mm;
  }
  Rigid3 operator*(const Rigid3& other) const {
    return {rotation * other.rotation, rotation * other.translation_mm + translation_mm};
  }
  Rigid3 inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation_mm)}; }
};

// Angle in rad of the rotation of a rigid motion, in [0, pi].
double rotation_angle_rad(const Rigid3& motion);

}  // namespace flamefield
