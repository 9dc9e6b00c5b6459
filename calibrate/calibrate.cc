#include "calibrate/calibrate.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <deque>
#include <map>
#include <set>

#include "calibrate/connect.h"
#include "calibrate/corner_order.h"
#include "calibrate/coverage.h"
#include "calibrate/links.h"
#include "calibrate/robust.h"
#include "calibrate/sightings.h"
#include "calibrate/uncertainty.h"

namespace flamefield {

namespace {

BundleOptions bundle_options(const CalibrationOptions& options) {
  BundleOptions out;
  out.intrinsics = options.intrinsics;
  out.prior = options.prior;
  out.free_aspect = options.free_aspect;
  out.free_tangential = options.free_tangential;
  out.free_k3 = options.free_k3;
  out.free_bow = options.free_bow;
  return out;
}

// Detections in one corner order a pose; the sightings point to them.
struct Renumbered {
  std::deque<Detection> detections;
  std::vector<bool> turned;  // (views)
};

Renumbered settle_order(Sightings& sightings, const Starts& starts, const BoardSpec& board) {
  const CornerOrder order = agree_on_order(sightings, starts, board);
  const std::vector<BoardTurn> turns = look_alike_turns(board);
  Renumbered out;
  for (std::size_t v = 0; v < sightings.views.size(); ++v) {
    Sightings::View& view = sightings.views[v];
    out.turned.push_back(order.turn[v] > 0);
    if (order.turn[v] == 0 && order.settled[v]) continue;
    Detection& changed = out.detections.emplace_back(*view.detection);
    view.detection = &changed;
    if (order.settled[v]) {
      changed.corners_px = reordered(changed.corners_px, turns[order.turn[v]]);
    } else {
      changed.corners_px.clear();
      changed.reason = "corner order unknown: the camera shares too few board orientations with the others";
    }
  }
  return out;
}

// The sums behind every RMS.
struct Tally {
  int images = 0, corners = 0, rejected = 0;
  double sum_squared = 0;

  void add(const ViewReport& view) {
    if (!view.is_used()) {
      if (!view.used.empty()) rejected += static_cast<int>(count_seen(view.corners_px));
      return;
    }
    const int good = static_cast<int>(count_seen(view.corners_px)) - view.rejected;
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
  out.residuals_px = residuals_px(bundle, solved);
  double sum = 0;
  for (std::size_t i = 0; i < solved.corners_px.size(); ++i) {
    if (solved.used[i]) sum += out.residuals_px[i].squaredNorm();
  }
  out.rejected = static_cast<int>(static_cast<std::ptrdiff_t>(count_seen(out.corners_px)) - good);
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

// The focal length of a lens shows in the perspective of slanted boards only.
Result<> check_orientations(const Bundle& bundle, const CalibrationOptions& options) {
  if (options.intrinsics == IntrinsicsMode::Fixed ||
      std::ranges::find(bundle.focal_known, false) == bundle.focal_known.end())
    return {};
  double widest_rad = 0;
  const Eigen::Vector3d first = bundle.world_from_board.front().rotation.col(2);
  for (const Rigid3& pose : bundle.world_from_board)
    widest_rad = std::max(
        widest_rad, std::atan2(first.cross(pose.rotation.col(2)).norm(), first.dot(pose.rotation.col(2))));
  constexpr double kEnough_rad = 0.09;  // 5 degrees
  if (widest_rad > kEnough_rad) return {};
  return invalid_input("all board poses are parallel", "focal length and distance cannot be told apart",
                       "tilt the board by 20 degrees or more either way, or state the lenses");
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

void fill_uncertainty(CalibrationReport& report, const Bundle& bundle, const Uncertainty& known,
                      const MeasuringVolume& volume) {
  VolumeError& expected = report.expected_volume_error;
  const auto cameras = static_cast<double>(bundle.cameras.size());
  std::vector<double> variance(points_of(volume).size(), 0);
  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    const CameraSigma& sigma = known.cameras[c];
    const Camera& camera = bundle.cameras[c];
    report.camera_volume_px.push_back(sigma.volume_px);
    const double distance_mm = (camera.centre_mm() - volume.centre_mm).norm();
    report.expected_volume_error_mm += sigma.volume_px * distance_mm / camera.fx_px / cameras;
    expected.mean_px += sigma.volume_px / cameras;
    for (std::size_t p = 0; p < variance.size(); ++p)
      variance[p] += sigma.point_px[p] * sigma.point_px[p] / cameras;
    if (sigma.volume_px < expected.worst_px) continue;
    expected.worst_px = sigma.volume_px;
    expected.worst_camera = camera.name;
  }
  for (double v : variance) report.volume_map_px.push_back(std::sqrt(v));
  report.clustering = known.clustering;
  report.bow_mm = bundle.bow_mm;
  report.bow_sigma_mm = known.bow_sigma_mm;
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

  const auto known = uncertainty(bundle, options, report.sigma_px, points_of(volume));
  if (known) fill_uncertainty(report, bundle, *known, volume);
  RigQuality quality;
  quality.rms_px = report.rms_px;
  quality.board_poses = static_cast<int>(bundle.world_from_board.size());
  for (std::size_t c = 0; c < bundle.cameras.size(); ++c) {
    const Tally& tally = by_camera[bundle.cameras[c].name];
    CameraQuality camera{tally.images, tally.corners, tally.rejected, tally.rms_px(), 0, 0, 0};
    if (known) {
      camera.focal_sigma_px = known->cameras[c].focal_px;
      camera.position_sigma_mm = known->cameras[c].position_mm;
      camera.rotation_sigma_rad = known->cameras[c].rotation_rad;
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
  auto sightings = sight(detections, board, options);
  if (!sightings) return tl::unexpected(sightings.error());
  const auto starts = start_cameras(*sightings, board, options);
  if (!starts) return tl::unexpected(starts.error());
  const Renumbered renumbered = settle_order(*sightings, *starts, board);
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
  report.missing_links = missing_links(*sightings, connected);
  if (!report.connected && options.require_connected) {
    return invalid_input(concat("not tied to the other cameras: ", joined(report.unconnected)),
                         concat("no chain of board poses leads from the reference pose '",
                                report.reference_pose, "' to them", unseen_text(*sightings)),
                         advice_text(report.missing_links));
  }

  if (auto ok = check_orientations(bundle, options); !ok) return tl::unexpected(ok.error());

  BundleOptions solving = bundle_options(options);
  report.volume = options.volume;
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
    report.views.back().turned = renumbered.turned[v];
    report.turned_views += renumbered.turned[v];
  }
  report.pairs = shared_poses(report);
  report.coverage = coverage_of(report, board);
  fill_quality(report, bundle, solving, options.volume);
  if (options.split_half) report.split_half = split_half(bundle, solving, options.volume);
  report.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_time).count();
  return report;
}

}  // namespace flamefield
