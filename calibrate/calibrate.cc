#include "calibrate/calibrate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <set>

#include "calibrate/connect.h"
#include "calibrate/robust.h"
#include "calibrate/sightings.h"

namespace flamefield {

namespace {

BundleOptions bundle_options(const CalibrationOptions& options) {
  BundleOptions out;
  out.intrinsics = options.intrinsics;
  out.prior = options.prior;
  out.free_aspect = options.free_aspect;
  out.free_tangential = options.free_tangential;
  out.free_k3 = options.free_k3;
  return out;
}

// The sums behind every RMS.
struct Tally {
  int images = 0, corners = 0, rejected = 0;
  double sum_squared = 0;

  void add(const ViewReport& view) {
    if (!view.is_used()) {
      rejected += static_cast<int>(view.used.size());
      return;
    }
    const int good = static_cast<int>(view.residuals_px.size()) - view.rejected;
    ++images;
    corners += good;
    rejected += view.rejected;
    sum_squared += view.rms_px * view.rms_px * good;
  }
  double rms_px() const { return corners > 0 ? std::sqrt(sum_squared / corners) : 0; }
};

ViewReport report_view(const Sightings::View& view, const Bundle& bundle, std::size_t bundle_view) {
  ViewReport out;
  out.camera = view.detection->camera;
  out.pose = view.detection->pose;
  out.corners_px = view.detection->corners_px;
  out.reason = view.detection->reason;
  if (!view.detection->found()) return out;
  if (bundle_view == kNotSolved) {
    out.reason = "not connected to the reference pose";
    return out;
  }
  const BundleView& solved = bundle.views[bundle_view];
  out.used = solved.used;
  const auto good = std::ranges::count(solved.used, true);
  if (good == 0) {
    out.reason = "contradicts the other views (board moved, or corners in another order?)";
    return out;
  }
  double sum = 0;
  for (std::size_t i = 0; i < solved.corners_px.size(); ++i) {
    out.residuals_px.push_back(residual_px(bundle, solved, i));
    if (solved.used[i]) sum += out.residuals_px.back().squaredNorm();
  }
  out.rejected = static_cast<int>(std::ssize(solved.used) - good);
  out.rms_px = std::sqrt(sum / static_cast<double>(good));
  return out;
}

std::vector<SharedPoses> shared_poses(const CalibrationReport& report) {
  std::map<std::string, std::set<std::string>> poses_of;
  for (const ViewReport& view : report.views) {
    if (view.is_used()) poses_of[view.camera].insert(view.pose);
  }
  std::vector<SharedPoses> pairs;
  for (std::size_t a = 0; a < report.cameras.size(); ++a) {
    for (std::size_t b = a + 1; b < report.cameras.size(); ++b) {
      const std::set<std::string>&first = poses_of[report.cameras[a]], &second = poses_of[report.cameras[b]];
      const auto both = std::ranges::count_if(first, [&](const auto& pose) { return second.contains(pose); });
      if (both > 0) pairs.push_back({report.cameras[a], report.cameras[b], static_cast<int>(both)});
    }
  }
  return pairs;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

void fill_quality(CalibrationReport& report, const Bundle& bundle, const BundleOptions& options,
                  const MeasuringVolume& volume) {
  Tally all;
  std::map<std::string, Tally> by_camera;
  for (const ViewReport& view : report.views) {
    all.add(view);
    by_camera[view.camera].add(view);
  }
  report.rms_px = all.rms_px();
  report.corners = all.corners;
  report.rejected_corners = all.rejected;
  const int redundancy = 2 * all.corners - free_parameters(bundle, options);
  report.sigma_px = redundancy > 0 ? std::sqrt(all.sum_squared / redundancy) : 0;

  const auto sigmas = camera_sigmas(bundle, options, report.sigma_px, points_of(volume));
  RigQuality quality;
  quality.rms_px = report.rms_px;
  quality.board_poses = static_cast<int>(bundle.world_from_board.size());
  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    const Tally& tally = by_camera[bundle.cameras[c].name];
    CameraQuality camera{tally.images, tally.corners, tally.rejected, tally.rms_px(), 0, 0, 0};
    if (!sigmas.empty()) {
      camera.focal_sigma_px = sigmas[c].focal_px;
      camera.position_sigma_mm = sigmas[c].position_mm;
      camera.rotation_sigma_rad = sigmas[c].rotation_rad;
      report.expected_volume_error.mean_px +=
          sigmas[c].volume_px / static_cast<double>(bundle.cameras.size());
      if (sigmas[c].volume_px >= report.expected_volume_error.worst_px) {
        report.expected_volume_error.worst_px = sigmas[c].volume_px;
        report.expected_volume_error.worst_camera = bundle.cameras[c].name;
      }
    }
    quality.cameras.push_back(camera);
  }
  report.rig.quality = quality;
}

}  // namespace

Result<CalibrationReport> calibrate(std::span<const Detection> detections, const BoardSpec& board,
                                    const CalibrationOptions& options) {
  const auto start_time = std::chrono::steady_clock::now();
  if (auto ok = validate(board); !ok) return tl::unexpected(ok.error());
  const auto sightings = sight(detections, board, options.reference_pose);
  if (!sightings) return tl::unexpected(sightings.error());
  const auto starts = start_cameras(*sightings, board, options);
  if (!starts) return tl::unexpected(starts.error());
  Connected connected = connect(*sightings, *starts, board, options);
  Bundle& bundle = connected.bundle;

  CalibrationReport report;
  report.cameras = sightings->cameras;
  report.poses = sightings->poses;
  report.reference_pose = sightings->poses[sightings->reference];
  for (std::size_t c = 0; c < sightings->cameras.size(); ++c) {
    if (std::ranges::find(connected.session_camera, c) == connected.session_camera.end()) {
      report.unconnected.push_back(sightings->cameras[c]);
    }
  }
  report.connected = report.unconnected.empty();
  if (!report.connected && options.require_connected) {
    return invalid_input(
        concat("not tied to the other cameras: ", joined(report.unconnected)),
        concat("no chain of board poses leads from the reference pose '", report.reference_pose, "' to them"),
        "show the board so that each of them and a neighbour see it at once");
  }

  BundleOptions solving = bundle_options(options);
  const BundleSummary summary = solve_with_rejection(bundle, solving, options.reject_sigmas);
  if (!hangs_together(bundle)) {
    return invalid_input("the board views contradict each other",
                         "without the views that disagree some cameras are not tied to the others",
                         "hold the board still during an exposure, check --board, and take more poses");
  }
  report.converged = summary.converged;
  report.iterations = summary.iterations;
  report.stop_reason = summary.stop_reason;
  report.rig.cameras = bundle.cameras;
  report.world_from_board.resize(report.poses.size());
  for (std::size_t p = 0; p < connected.session_pose.size(); ++p) {
    report.world_from_board[connected.session_pose[p]] = bundle.world_from_board[p];
  }
  for (std::size_t v = 0; v < sightings->views.size(); ++v) {
    report.views.push_back(report_view(sightings->views[v], bundle, connected.bundle_view[v]));
  }
  report.pairs = shared_poses(report);
  fill_quality(report, bundle, solving, options.volume);
  if (options.split_half) report.split_half = split_half(bundle, solving, options.volume);
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count();
  return report;
}

}  // namespace flamefield
