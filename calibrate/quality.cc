#include "calibrate/quality.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace flamefield {

namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;

struct Pair {
  const Camera* estimated;
  const Camera* truth;
};

Rigid3 motion_of(const Vector6& v) {
  const double angle = v.head<3>().norm();
  Rigid3 out;
  if (angle > 0) out.rotation = Eigen::AngleAxisd(angle, v.head<3>() / angle).toRotationMatrix();
  out.translation_mm = v.tail<3>();
  return out;
}

// Estimated minus true pixel; a point behind a camera counts as far off.
Eigen::Vector2d shift_px(const Pair& pair, const Rigid3& estimated_from_true,
                         const Eigen::Vector3d& point_mm) {
  const auto a = project(*pair.estimated, estimated_from_true * point_mm), b = project(*pair.truth, point_mm);
  return a && b ? Eigen::Vector2d(*a - *b) : Eigen::Vector2d(1e6, 0);
}

// The rigid motion that makes the shifts smallest: Gauss-Newton with differences, started at the motion that
// makes one camera pose agree.
Rigid3 align(const std::vector<Pair>& pairs, const std::vector<Eigen::Vector3d>& points) {
  const Pair& middle = pairs[pairs.size() / 2];
  Rigid3 motion = middle.estimated->camera_from_world.inverse() * middle.truth->camera_from_world;
  constexpr double kStep[6] = {1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4};  // rad, mm
  for (int iteration = 0; iteration < 15; ++iteration) {
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Vector6 gradient = Vector6::Zero();
    for (const Pair& pair : pairs) {
      for (const Eigen::Vector3d& point : points) {
        const Eigen::Vector2d r = shift_px(pair, motion, point);
        Eigen::Matrix<double, 2, 6> j;
        for (int k = 0; k < 6; ++k) {
          j.col(k) = (shift_px(pair, motion_of(kStep[k] * Vector6::Unit(k)) * motion, point) - r) / kStep[k];
        }
        normal += j.transpose() * j;
        gradient += j.transpose() * r;
      }
    }
    const Vector6 step = -normal.ldlt().solve(gradient);
    motion = motion_of(step) * motion;
    if (step.cwiseAbs().maxCoeff() < 1e-9) break;
  }
  return motion;
}

}  // namespace

std::vector<Eigen::Vector3d> points_of(const MeasuringVolume& volume) {
  std::vector<Eigen::Vector3d> points;
  constexpr int kHeights = 5, kAngles = 12;
  for (int h = 0; h < kHeights; ++h) {
    const double y = volume.height_mm * (static_cast<double>(h) / (kHeights - 1) - 0.5);
    points.push_back(volume.centre_mm + Eigen::Vector3d(0, y, 0));
    for (double radius : {0.25 * volume.diameter_mm, 0.5 * volume.diameter_mm}) {
      for (int a = 0; a < kAngles; ++a) {
        const double phi = 2 * std::numbers::pi * a / kAngles;
        points.push_back(volume.centre_mm +
                         Eigen::Vector3d(radius * std::cos(phi), y, radius * std::sin(phi)));
      }
    }
  }
  return points;
}

Result<VolumeError> volume_error_px(const Rig& estimated, const Rig& truth, const MeasuringVolume& volume,
                                    Alignment alignment) {
  std::vector<Pair> pairs;
  for (const Camera& camera : truth.cameras) {
    const auto at = estimated.find(camera.name);
    if (!at) {
      return invalid_input(concat("camera ", camera.name, " is missing in the estimated rig"),
                           "both rigs must name the same cameras", "compare rigs of one array");
    }
    pairs.push_back({&estimated.cameras[*at], &camera});
  }
  if (pairs.empty()) return invalid_input("the rig has no cameras", "nothing to compare", "calibrate first");

  const std::vector<Eigen::Vector3d> points = points_of(volume);
  const Rigid3 motion = alignment == Alignment::Rigid ? align(pairs, points) : Rigid3();
  VolumeError error;
  for (const Pair& pair : pairs) {
    double sum = 0;
    for (const Eigen::Vector3d& point : points) sum += shift_px(pair, motion, point).squaredNorm();
    const double rms = std::sqrt(sum / static_cast<double>(points.size()));
    error.mean_px += rms / static_cast<double>(pairs.size());
    if (error.worst_camera.empty() || !(rms <= error.worst_px)) {
      error.worst_px = rms;
      error.worst_camera = pair.truth->name;
    }
  }
  return error;
}

Rigid3 rigid_alignment(const Rig& estimated, const Rig& truth, const MeasuringVolume& volume) {
  std::vector<Pair> pairs;
  for (std::size_t c = 0; c < truth.cameras.size(); ++c)
    pairs.push_back({&estimated.cameras[c], &truth.cameras[c]});
  return align(pairs, points_of(volume));
}

Verdict verdict_of(const VolumeError& error) {
  if (error.worst_px <= 0.2) return Verdict::Green;
  return error.worst_px <= 0.5 ? Verdict::Amber : Verdict::Red;
}

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::Green:
      return "green";
    case Verdict::Amber:
      return "amber";
    case Verdict::Red:
      return "red";
  }
  return "unknown";
}

}  // namespace flamefield
