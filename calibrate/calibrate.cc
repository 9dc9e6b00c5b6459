#include "calibrate/calibrate.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <set>

#include "calibrate/sightings.h"
#include "calibrate/start.h"

namespace flamefield {

namespace {

constexpr std::size_t kNone = static_cast<std::size_t>(-1);

// The connected part of a session, numbered without gaps, and the way back to the session's numbers.
struct Connected {
  Bundle bundle;
  std::vector<std::size_t> session_camera, session_pose;  // of each camera and pose of the bundle
  std::vector<std::size_t> bundle_view;                   // of each sighting, or kNone
};

struct Starts {
  std::vector<std::optional<Camera>> cameras;
  std::vector<bool> focal_known;
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

const Camera* find_known(const CalibrationOptions& options, const std::string& name) {
  const auto at = std::ranges::find(options.known, name, &Camera::name);
  return at == options.known.end() ? nullptr : &*at;
}

// A camera whose own views say nothing borrows the median focal length of the others.
void lend_focal_lengths(const Sightings& sightings, Starts& starts) {
  std::vector<double> focal;
  for (const auto& camera : starts.cameras) {
    if (camera) focal.push_back(camera->fx_px);
  }
  for (std::size_t c = 0; c < starts.cameras.size(); ++c) {
    const auto found = sightings.found_by(c);
    if (starts.cameras[c] || found.empty()) continue;
    Camera camera;
    camera.name = sightings.cameras[c];
    camera.image_width_px = found[0]->image_width_px;
    camera.image_height_px = found[0]->image_height_px;
    camera.fx_px = camera.fy_px = focal.empty() ? 1.5 * camera.image_width_px : median(focal);
    camera.cx_px = 0.5 * (camera.image_width_px - 1);
    camera.cy_px = 0.5 * (camera.image_height_px - 1);
    starts.cameras[c] = camera;
  }
}

Result<Starts> start_cameras(const Sightings& sightings, const BoardSpec& board,
                             const CalibrationOptions& options) {
  Starts starts{std::vector<std::optional<Camera>>(sightings.cameras.size()),
                std::vector<bool>(sightings.cameras.size(), false)};
  for (std::size_t c = 0; c < sightings.cameras.size(); ++c) {
    const auto found = sightings.found_by(c);
    if (found.empty()) continue;
    const Camera* known = find_known(options, sightings.cameras[c]);
    if (options.intrinsics == IntrinsicsMode::Fixed && known == nullptr) {
      return invalid_input(concat("camera ", sightings.cameras[c], " has no known intrinsics"),
                           "they are to stay fixed", "name a rig that has them, or use --intrinsics prior");
    }
    if (known != nullptr) {
      if (known->image_width_px != found[0]->image_width_px ||
          known->image_height_px != found[0]->image_height_px) {
        return invalid_input(
            concat("camera ", known->name, ": known intrinsics are for ", known->image_width_px, "x",
                   known->image_height_px, " px"),
            concat("its images are ", found[0]->image_width_px, "x", found[0]->image_height_px),
            "use intrinsics of the same region of interest");
      }
      starts.cameras[c] = *known;
      starts.focal_known[c] = true;
      continue;
    }
    starts.cameras[c] = single_camera_start(found, board);
    if (options.focal_px) {
      if (!starts.cameras[c]) lend_focal_lengths(sightings, starts);
      starts.cameras[c]->fx_px = starts.cameras[c]->fy_px = *options.focal_px;
      starts.focal_known[c] = true;
    }
  }
  lend_focal_lengths(sightings, starts);
  return starts;
}

// Poses of single views, chained to the reference; what hangs together becomes the bundle.
Connected connect(const Sightings& sightings, const Starts& starts, const BoardSpec& board,
                  const CalibrationOptions& options) {
  std::vector<Edge> edges;
  std::vector<bool> posed(sightings.views.size(), false);
  for (std::size_t v = 0; v < sightings.views.size(); ++v) {
    const Sightings::View& view = sightings.views[v];
    if (!view.detection->found()) continue;
    const auto pose = single_pose(*starts.cameras[view.camera], *view.detection, board);
    if (!pose) continue;
    edges.push_back({view.camera, view.pose, *pose});
    posed[v] = true;
  }
  const Chain chain = chain_poses(edges, sightings.cameras.size(), sightings.poses.size(),
                                  sightings.reference, options.world_from_reference);

  Connected out;
  std::vector<std::size_t> camera_at(sightings.cameras.size(), kNone), pose_at(sightings.poses.size(), kNone);
  for (std::size_t c = 0; c < sightings.cameras.size(); ++c) {
    if (!chain.camera_from_world[c]) continue;
    camera_at[c] = out.session_camera.size();
    out.session_camera.push_back(c);
    Camera camera = *starts.cameras[c];
    camera.camera_from_world = *chain.camera_from_world[c];
    out.bundle.cameras.push_back(camera);
    out.bundle.known.push_back(*starts.cameras[c]);
    out.bundle.focal_known.push_back(starts.focal_known[c]);
  }
  for (std::size_t p = 0; p < sightings.poses.size(); ++p) {
    if (!chain.world_from_board[p]) continue;
    pose_at[p] = out.session_pose.size();
    out.session_pose.push_back(p);
    out.bundle.world_from_board.push_back(*chain.world_from_board[p]);
  }
  out.bundle.fixed_pose = pose_at[sightings.reference];
  out.bundle.board_mm = corners_mm(board);
  for (std::size_t v = 0; v < sightings.views.size(); ++v) {
    const Sightings::View& view = sightings.views[v];
    out.bundle_view.push_back(kNone);
    if (!posed[v] || camera_at[view.camera] == kNone || pose_at[view.pose] == kNone) continue;
    out.bundle_view.back() = out.bundle.views.size();
    out.bundle.views.push_back({camera_at[view.camera], pose_at[view.pose], view.detection->corners_px,
                                std::vector<bool>(view.detection->corners_px.size(), true)});
  }
  return out;
}

// Sigma of one coordinate from the median of all residuals: half of them may be wrong.
double robust_sigma_px(const Bundle& bundle) {
  std::vector<double> sizes;
  for (const BundleView& view : bundle.views) {
    for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
      const Eigen::Vector2d r = residual_px(bundle, view, i);
      sizes.push_back(std::abs(r.x()));
      sizes.push_back(std::abs(r.y()));
    }
  }
  constexpr double kMedianOfHalfNormal = 0.6745;
  return std::max(1e-4, median(std::move(sizes)) / kMedianOfHalfNormal);
}

// Marks corners further off than `limit_px`; a view that loses half of them is wrong as a whole.
void reject_corners(Bundle& bundle, double limit_px) {
  for (BundleView& view : bundle.views) {
    std::size_t good = 0;
    for (std::size_t i = 0; i < view.corners_px.size(); ++i) {
      view.used[i] = residual_px(bundle, view, i).norm() <= limit_px;
      good += view.used[i];
    }
    if (2 * good < view.used.size()) view.used.assign(view.used.size(), false);
  }
}

BundleOptions bundle_options(const CalibrationOptions& options) {
  BundleOptions out;
  out.intrinsics = options.intrinsics;
  out.prior = options.prior;
  out.free_aspect = options.free_aspect;
  out.free_tangential = options.free_tangential;
  out.free_k3 = options.free_k3;
  return out;
}

// Robustly to find the outliers, then twice without them.
BundleSummary solve_with_rejection(Bundle& bundle, BundleOptions& options, double reject_sigmas) {
  options.robust_px = 1;
  BundleSummary summary = solve_bundle(bundle, options);
  options.robust_px = 0;
  for (int round = 0; round < 2; ++round) {
    options.noise_px = robust_sigma_px(bundle);
    reject_corners(bundle, reject_sigmas * options.noise_px);
    const int before = summary.iterations;
    summary = solve_bundle(bundle, options);
    summary.iterations += before;
  }
  return summary;
}

// Every camera and pose that a bundle's used views reach from its fixed pose.
bool hangs_together(const Bundle& bundle) {
  std::vector<Edge> edges;
  for (const BundleView& view : bundle.views) {
    if (std::ranges::find(view.used, true) != view.used.end()) edges.push_back({view.camera, view.pose, {}});
  }
  const Chain chain =
      chain_poses(edges, bundle.cameras.size(), bundle.world_from_board.size(), bundle.fixed_pose, Rigid3());
  return std::ranges::all_of(chain.camera_from_world, [](const auto& pose) { return pose.has_value(); });
}

std::optional<SplitHalf> split_half(const Bundle& whole, const BundleOptions& options,
                                    const MeasuringVolume& volume) {
  constexpr std::size_t kEnough = 10;  // poses: half of fewer cannot tell lenses from poses
  if (whole.world_from_board.size() < kEnough) return std::nullopt;
  Rig halves[2];
  for (std::size_t half = 0; half < 2; ++half) {
    Bundle bundle = whole;
    std::erase_if(bundle.views, [&](const BundleView& view) {
      return view.pose != whole.fixed_pose && view.pose % 2 != half;
    });
    if (!hangs_together(bundle)) return std::nullopt;
    solve_bundle(bundle, options);
    halves[half].cameras = bundle.cameras;
  }
  SplitHalf out;
  double rotation = 0, translation = 0;
  const double cameras = static_cast<double>(whole.cameras.size());
  for (std::size_t c = 0; c < whole.cameras.size(); ++c) {
    const Camera &a = halves[0].cameras[c], &b = halves[1].cameras[c];
    const double turn = rotation_angle_rad(a.camera_from_world * b.camera_from_world.inverse());
    rotation += turn * turn / cameras;
    translation += (a.centre_mm() - b.centre_mm()).squaredNorm() / cameras;
  }
  out.rotation_rad = std::sqrt(rotation);
  out.translation_mm = std::sqrt(translation);
  if (auto error = volume_error_px(halves[0], halves[1], volume)) out.volume = *error;
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
  if (bundle_view == kNone) {
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
