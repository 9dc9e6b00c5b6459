#include "proto/rigid3.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

namespace flamefield {
namespace {

Rigid3 some_motion(double angle_rad) {
  return {Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
          Eigen::Vector3d(10, -20, 30)};
}

TEST(Rigid3, InverseUndoesTheMotion) {
  const Rigid3 motion = some_motion(0.7);
  const Eigen::Vector3d point(1, 2, 3);
  EXPECT_LT((motion.inverse() * (motion * point) - point).norm(), 1e-12);
}

TEST(Rigid3, CompositionAppliesTheRightMotionFirst) {
  const Rigid3 a = some_motion(0.7), b = some_motion(-0.2);
  const Eigen::Vector3d point(1, 2, 3);
  EXPECT_LT(((a * b) * point - a * (b * point)).norm(), 1e-12);
}

TEST(Rigid3, RotationAngleIsExactForTinyAngles) {
  EXPECT_NEAR(rotation_angle_rad(some_motion(1e-9)), 1e-9, 1e-14);
}

}  // namespace
}  // namespace flamefield
