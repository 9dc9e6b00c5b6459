#include "calibrate/compare.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "calibrate/median.h"

namespace flamefield {

namespace {

double rms_shift_px(const Camera& now, const Camera& before, const Rigid3& now_from_before,
                    const std::vector<Eigen::Vector3d>& points) {
  double sum = 0;
  for (const Eigen::Vector3d& point : points) {
    const auto a = project(now, now_from_before * point), b = project(before, point);
    sum += a && b ? (*a - *b).squaredNorm() : 1e12;
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

std::vector<double> shifts_px(const Rig& now, const Rig& before, const Rigid3& now_from_before,
                              const std::vector<Eigen::Vector3d>& points) {
  std::vector<double> out;
  for (std::size_t c = 0; c < now.cameras.size(); ++c)
    out.push_back(rms_shift_px(now.cameras[c], before.cameras[c], now_from_before, points));
  return out;
}

}  // namespace

Result<RigComparison> compare_rigs(const Rig& now, const Rig& before, const MeasuringVolume& volume,
                                   const CheckOptions& options) {
  RigComparison out;
  Rig a, b;  // the cameras in common
  for (const Camera& camera : now.cameras) {
    const auto at = before.find(camera.name);
    if (!at) {
      out.added.push_back(camera.name);
      continue;
    }
    a.cameras.push_back(camera);
    b.cameras.push_back(before.cameras[*at]);
  }
  for (const Camera& camera : before.cameras)
    if (!now.find(camera.name)) out.missing.push_back(camera.name);
  if (a.cameras.size() < 3) {
    return invalid_input(concat("the rigs have ", a.cameras.size(), " cameras in common"),
                         "fewer than three cannot tell which of them has moved", "compare rigs of one array");
  }
  const std::vector<Eigen::Vector3d> points = points_of(volume);
  // By each camera alone first, whichever most others agree with; then by all that do.
  Rigid3 motion;
  std::optional<double> best;
  for (std::size_t c = 0; c < a.cameras.size(); ++c) {
    const Rigid3 by_one = a.cameras[c].camera_from_world.inverse() * b.cameras[c].camera_from_world;
    const double middle = median(shifts_px(a, b, by_one, points));
    if (best && middle >= *best) continue;
    best = middle;
    motion = by_one;
  }
  std::vector<double> shifts = shifts_px(a, b, motion, points);
  double limit = 0;
  for (int round = 0; round < 4; ++round) {
    // Half of the cameras always counts as standing still.
    limit = std::max({options.moved_px, options.moved_factor * median(shifts)});
    Rig still_a, still_b;
    for (std::size_t c = 0; c < shifts.size(); ++c) {
      if (shifts[c] > limit) continue;
      still_a.cameras.push_back(a.cameras[c]);
      still_b.cameras.push_back(b.cameras[c]);
    }
    motion = rigid_alignment(still_a, still_b, volume);
    shifts = shifts_px(a, b, motion, points);
  }
  limit = std::max(options.moved_px, options.moved_factor * median(shifts));
  for (std::size_t c = 0; c < shifts.size(); ++c) {
    out.cameras.push_back({a.cameras[c].name, shifts[c], shifts[c] > limit});
    if (shifts[c] > limit) out.moved.push_back(a.cameras[c].name);
  }
  out.world_shift_mm = (motion * volume.centre_mm - volume.centre_mm).norm();
  out.world_turn_rad = rotation_angle_rad(motion);
  return out;
}

}  // namespace flamefield
