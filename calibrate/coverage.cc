#include "calibrate/coverage.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace flamefield {

namespace {

double image_share(const CalibrationReport& report, const Camera& camera) {
  constexpr int kAcross = 8, kDown = 6;
  std::set<int> cells;
  for (const ViewReport& view : report.views) {
    if (view.camera != camera.name || !view.is_used()) continue;
    for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
      if (!view.used[i]) continue;
      const Eigen::Vector2d& p = view.corners_px[i];
      const int x = std::clamp(static_cast<int>(kAcross * (p.x() + 0.5) / camera.image_width_px), 0,
                               kAcross - 1),
                y = std::clamp(static_cast<int>(kDown * (p.y() + 0.5) / camera.image_height_px), 0,
                               kDown - 1);
      cells.insert(kAcross * y + x);
    }
  }
  return static_cast<double>(cells.size()) / (kAcross * kDown);
}

std::vector<Eigen::Vector3d> corners_in_world(const CalibrationReport& report, const BoardSpec& board) {
  std::vector<Eigen::Vector3d> corners;
  for (std::size_t p = 0; p < report.poses.size(); ++p) {
    const bool used = std::ranges::any_of(
        report.views, [&](const ViewReport& view) { return view.pose == report.poses[p] && view.is_used(); });
    if (!used || !report.world_from_board[p]) continue;
    for (const Eigen::Vector3d& corner : corners_mm(board))
      corners.push_back(*report.world_from_board[p] * corner);
  }
  return corners;
}

double volume_share(const CalibrationReport& report, const BoardSpec& board) {
  const std::vector<Eigen::Vector3d> corners = corners_in_world(report, board);
  const MeasuringVolume& volume = report.volume;
  const double step = board.square_mm, radius = 0.5 * volume.diameter_mm;
  int inside = 0, covered = 0;
  for (double y = -0.5 * volume.height_mm + 0.5 * step; y < 0.5 * volume.height_mm; y += step) {
    for (double x = -radius + 0.5 * step; x < radius; x += step) {
      for (double z = -radius + 0.5 * step; z < radius; z += step) {
        if (x * x + z * z > radius * radius) continue;
        ++inside;
        const Eigen::Vector3d at = volume.centre_mm + Eigen::Vector3d(x, y, z);
        covered += std::ranges::any_of(corners, [&](const auto& c) { return (c - at).norm() <= step; });
      }
    }
  }
  return inside > 0 ? static_cast<double>(covered) / inside : 0;
}

}  // namespace

Coverage coverage_of(const CalibrationReport& report, const BoardSpec& board) {
  Coverage out;
  for (const Camera& camera : report.rig.cameras) out.image.push_back(image_share(report, camera));
  out.volume = volume_share(report, board);
  return out;
}

}  // namespace flamefield
