#pragma once

#include <ceres/manifold.h>
#include <ceres/sized_cost_function.h>

#include <Eigen/Geometry>
#include <array>

#include "proto/camera.h"

namespace flamefield {

// Parameter blocks of the bundle: a pose is a unit quaternion (x y z w) and a translation in mm; a lens is
// f_px, aspect fy/fx, cx, cy, k1, k2, p1, p2, k3.
using PoseBlock = std::array<double, 7>;
using LensBlock = std::array<double, 9>;
enum LensIndex { kFocal, kAspect, kCx, kCy, kK1, kK2, kP1, kP2, kK3 };

PoseBlock pose_block(const Rigid3& motion);
Rigid3 rigid3_from(const PoseBlock& block);
LensBlock lens_block(const Camera& camera);
void set_lens(Camera& camera, const LensBlock& block);

// R <- exp(d) R, t <- t + d_t with the tangent (d, d_t). The cost below states its derivatives by the tangent
// and leaves the seventh ambient column empty, so the lift from tangent to ambient is (I; 0).
class PoseManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return 7; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* delta, double* x_plus_delta) const override;
  bool PlusJacobian(const double* x, double* jacobian) const override;
  bool Minus(const double* y, const double* x, double* y_minus_x) const override;
  bool MinusJacobian(const double* x, double* jacobian) const override;
};

// Sagitta of the board along its columns and rows, mm.
using BowBlock = std::array<double, 2>;

// Pixel of a board point minus its measured pixel. Blocks: lens, camera_from_world, world_from_board, bow. A
// bow lifts the point along the board's normal by bow . bow_shape.
class ReprojectionCost : public ceres::SizedCostFunction<2, 9, 7, 7, 2> {
 public:
  ReprojectionCost(const Eigen::Vector3d& board_mm, const Eigen::Vector2d& bow_shape,
                   const Eigen::Vector2d& measured_px)
      : board_mm_(board_mm), bow_shape_(bow_shape), measured_px_(measured_px) {}
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::Vector3d board_mm_;
  Eigen::Vector2d bow_shape_;
  Eigen::Vector2d measured_px_;
};

}  // namespace flamefield
