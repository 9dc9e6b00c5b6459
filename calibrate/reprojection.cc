#include "calibrate/reprojection.h"

#include <algorithm>

namespace flamefield {

namespace {

template <int Rows, int Cols>
using RowMajor = Eigen::Matrix<double, Rows, Cols, Eigen::RowMajor>;

Eigen::Quaterniond rotation_of(const double* block) {
  return Eigen::Quaterniond(block[3], block[0], block[1], block[2]);
}
Eigen::Vector3d translation_of(const double* block) {
  return {block[4], block[5], block[6]};
}
Eigen::Matrix3d cross_matrix(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// OpenCV's lens model with its derivatives.
struct Lens {
  Eigen::Vector2d distorted;
  Eigen::Matrix2d by_normalised;
  RowMajor<2, 5> by_coefficients;  // k1 k2 p1 p2 k3
};
Lens distort(const double* lens, double x, double y) {
  const double k1 = lens[kK1], k2 = lens[kK2], p1 = lens[kP1], p2 = lens[kP2], k3 = lens[kK3];
  const double r2 = x * x + y * y, r4 = r2 * r2, r6 = r4 * r2;
  const double radial = 1 + k1 * r2 + k2 * r4 + k3 * r6;
  const double slope = k1 + 2 * k2 * r2 + 3 * k3 * r4;  // d radial / d r2
  Lens out;
  out.distorted << x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
      y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y;
  const double mixed = 2 * x * y * slope + 2 * p1 * x + 2 * p2 * y;
  out.by_normalised << radial + 2 * x * x * slope + 2 * p1 * y + 6 * p2 * x, mixed, mixed,
      radial + 2 * y * y * slope + 6 * p1 * y + 2 * p2 * x;
  out.by_coefficients << x * r2, x * r4, 2 * x * y, r2 + 2 * x * x, x * r6, y * r2, y * r4, r2 + 2 * y * y,
      2 * x * y, y * r6;
  return out;
}

}  // namespace

PoseBlock pose_block(const Rigid3& motion) {
  const Eigen::Quaterniond q = Eigen::Quaterniond(motion.rotation).normalized();
  const Eigen::Vector3d& t = motion.translation_mm;
  return {q.x(), q.y(), q.z(), q.w(), t.x(), t.y(), t.z()};
}

Rigid3 rigid3_from(const PoseBlock& block) {
  return {rotation_of(block.data()).normalized().toRotationMatrix(), translation_of(block.data())};
}

LensBlock lens_block(const Camera& camera) {
  const auto& d = camera.distortion;
  return {camera.fx_px, camera.fy_px / camera.fx_px, camera.cx_px, camera.cy_px, d[0], d[1], d[2], d[3],
          d[4]};
}

void set_lens(Camera& camera, const LensBlock& block) {
  camera.fx_px = block[kFocal];
  camera.fy_px = block[kFocal] * block[kAspect];
  camera.cx_px = block[kCx];
  camera.cy_px = block[kCy];
  std::copy(block.begin() + kK1, block.end(), camera.distortion.begin());
}

bool PoseManifold::Plus(const double* x, const double* delta, double* x_plus_delta) const {
  const Eigen::Vector3d turn(delta[0], delta[1], delta[2]);
  const double angle = turn.norm();
  const Eigen::Quaterniond step =
      angle > 0 ? Eigen::Quaterniond(Eigen::AngleAxisd(angle, turn / angle)) : Eigen::Quaterniond::Identity();
  const Eigen::Quaterniond q = (step * rotation_of(x)).normalized();
  const double out[7] = {q.x(), q.y(), q.z(), q.w(), x[4] + delta[3], x[5] + delta[4], x[6] + delta[5]};
  std::copy(out, out + 7, x_plus_delta);
  return true;
}

bool PoseManifold::PlusJacobian(const double*, double* jacobian) const {
  Eigen::Map<RowMajor<7, 6>>(jacobian).setIdentity();
  return true;
}

bool PoseManifold::Minus(const double* y, const double* x, double* y_minus_x) const {
  const Eigen::AngleAxisd turn(rotation_of(y) * rotation_of(x).conjugate());
  Eigen::Map<Eigen::Matrix<double, 6, 1>> out(y_minus_x);
  out << turn.angle() * turn.axis(), translation_of(y) - translation_of(x);
  return true;
}

bool PoseManifold::MinusJacobian(const double*, double* jacobian) const {
  Eigen::Map<RowMajor<6, 7>>(jacobian).setIdentity();
  return true;
}

bool ReprojectionCost::Evaluate(double const* const* parameters, double* residuals,
                                double** jacobians) const {
  const double* lens = parameters[0];
  const Eigen::Matrix3d camera_rotation = rotation_of(parameters[1]).toRotationMatrix();
  const Eigen::Matrix3d board_rotation = rotation_of(parameters[2]).toRotationMatrix();
  const double lift_mm = bow_shape_.x() * parameters[3][0] + bow_shape_.y() * parameters[3][1];
  const Eigen::Vector3d turned_board = board_rotation * (board_mm_ + Eigen::Vector3d(0, 0, lift_mm));
  const Eigen::Vector3d turned_world = camera_rotation * (turned_board + translation_of(parameters[2]));
  const Eigen::Vector3d p = turned_world + translation_of(parameters[1]);
  if (!(p.z() > 0)) return false;  // the step put the board behind the camera: not acceptable

  const double x = p.x() / p.z(), y = p.y() / p.z();
  const Lens shown = distort(lens, x, y);
  const Eigen::Vector2d focal(lens[kFocal], lens[kFocal] * lens[kAspect]);
  residuals[0] = focal.x() * shown.distorted.x() + lens[kCx] - measured_px_.x();
  residuals[1] = focal.y() * shown.distorted.y() + lens[kCy] - measured_px_.y();
  if (jacobians == nullptr) return true;

  if (jacobians[0] != nullptr) {
    Eigen::Map<RowMajor<2, 9>> j(jacobians[0]);
    j.setZero();
    j(0, kFocal) = shown.distorted.x();
    j(1, kFocal) = lens[kAspect] * shown.distorted.y();
    j(1, kAspect) = lens[kFocal] * shown.distorted.y();
    j(0, kCx) = j(1, kCy) = 1;
    j.rightCols<5>() = focal.asDiagonal() * shown.by_coefficients;
  }
  RowMajor<2, 3> normalised_by_point;
  normalised_by_point << 1 / p.z(), 0, -x / p.z(), 0, 1 / p.z(), -y / p.z();
  const RowMajor<2, 3> by_point = focal.asDiagonal() * shown.by_normalised * normalised_by_point;
  if (jacobians[1] != nullptr) {
    Eigen::Map<RowMajor<2, 7>> j(jacobians[1]);
    j << by_point * -cross_matrix(turned_world), by_point, Eigen::Vector2d::Zero();
  }
  if (jacobians[2] != nullptr) {
    const RowMajor<2, 3> by_world = by_point * camera_rotation;
    Eigen::Map<RowMajor<2, 7>> j(jacobians[2]);
    j << by_world * -cross_matrix(turned_board), by_world, Eigen::Vector2d::Zero();
  }
  if (jacobians[3] != nullptr) {
    const Eigen::Vector2d by_lift = by_point * camera_rotation * board_rotation.col(2);
    Eigen::Map<RowMajor<2, 2>> j(jacobians[3]);
    j = by_lift * bow_shape_.transpose();
  }
  return true;
}

}  // namespace flamefield
