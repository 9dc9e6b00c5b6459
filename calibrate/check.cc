#include "calibrate/check.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "calibrate/bundle.h"
#include "calibrate/corner_order.h"
#include "calibrate/median.h"
#include "calibrate/start.h"

namespace flamefield {

namespace {

double rms_px(const Bundle& bundle, const BundleView& view) {
  double sum = 0;
  for (const Eigen::Vector2d& r : residuals_px(bundle, view)) {
    if (r.allFinite()) sum += r.squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(count_seen(view.corners_px)));
}

// The view in the order in which it fits best, of those in which the board looks the same.
BundleView best_turned(const Bundle& bundle, const BundleView& view, const std::vector<BoardTurn>& turns) {
  BundleView best = view;
  for (const BoardTurn& turn : turns) {
    BundleView turned = view;
    turned.corners_px = reordered(view.corners_px, turn);
    if (rms_px(bundle, turned) < rms_px(bundle, best)) best = std::move(turned);
  }
  return best;
}

// The pose, among those that each camera sees alone, with which most of the others agree best.
std::optional<Rigid3> agreed_pose(Bundle& bundle, std::size_t pose, std::span<const Detection* const> seen,
                                  const BoardSpec& board) {
  const std::vector<BoardTurn> turns = look_alike_turns(board);
  std::optional<Rigid3> best;
  double best_px = 0;
  for (const Detection* detection : seen) {
    const auto camera = std::ranges::find(bundle.cameras, detection->camera, &Camera::name);
    const auto alone = single_pose(*camera, *detection, board);
    if (!alone) continue;
    bundle.world_from_board[pose] = camera->camera_from_world.inverse() * alone->camera_from_board;
    std::vector<double> errors;
    for (const BundleView& view : bundle.views) {
      if (view.pose == pose) errors.push_back(rms_px(bundle, best_turned(bundle, view, turns)));
    }
    const double middle = median(std::move(errors));
    if (best && middle >= best_px) continue;
    best = bundle.world_from_board[pose];
    best_px = middle;
  }
  return best;
}

Result<> check_input(const Rig& rig, std::span<const Detection> detections, const BoardSpec& board) {
  if (auto ok = validate(rig); !ok) return ok;
  std::set<std::string> with_board;
  for (const Detection& d : detections) {
    const auto at = rig.find(d.camera);
    if (!at) {
      return invalid_input(concat("camera ", d.camera, " is not in the rig"), "its place is unknown",
                           "check the names, or calibrate again");
    }
    const Camera& camera = rig.cameras[*at];
    if (camera.image_width_px != d.image_width_px || camera.image_height_px != d.image_height_px) {
      return invalid_input(
          concat("camera ", d.camera, ": image of ", d.image_width_px, "x", d.image_height_px),
          concat("the rig has ", camera.image_width_px, "x", camera.image_height_px),
          "use the region of interest of the calibration");
    }
    if (d.found() && d.corners_px.size() == board.corners()) with_board.insert(d.camera);
  }
  if (with_board.size() < 3) {
    return invalid_input(concat(with_board.size(), " cameras saw the board"),
                         "fewer than three cannot tell which of them has moved", "show it to more cameras");
  }
  return {};
}

// Board poses as the cameras of the bundle see them, the cameras held; views of `moved` do not count.
void place_boards(Bundle& bundle, const std::vector<bool>& moved) {
  for (BundleView& view : bundle.views) {
    for (std::size_t i = 0; i < view.used.size(); ++i)
      view.used[i] = !moved[view.camera] && is_seen(view.corners_px[i]);
  }
  BundleOptions options;
  options.hold_cameras = true;
  options.robust_px = 0.3;
  solve_bundle(bundle, options);
}

std::vector<CameraCheck> judge(const Bundle& bundle, const CheckOptions& options) {
  std::vector<CameraCheck> cameras(bundle.cameras.size());
  for (std::size_t c = 0; c < cameras.size(); ++c) cameras[c].camera = bundle.cameras[c].name;
  for (const BundleView& view : bundle.views) {
    CameraCheck& camera = cameras[view.camera];
    ++camera.images;
    for (const Eigen::Vector2d& r : residuals_px(bundle, view)) {
      if (!r.allFinite()) continue;  // not seen
      ++camera.corners;
      camera.mean_px += r;
      camera.rms_px += r.squaredNorm();
    }
  }
  std::vector<double> all;
  for (CameraCheck& camera : cameras) {
    if (camera.corners == 0) continue;
    camera.mean_px /= camera.corners;
    camera.rms_px = std::sqrt(camera.rms_px / camera.corners);
    all.push_back(camera.rms_px);
  }
  const double limit = std::max(options.moved_px, options.moved_factor * median(std::move(all)));
  for (CameraCheck& camera : cameras) camera.moved = camera.rms_px > limit;
  return cameras;
}

}  // namespace

Result<CheckReport> check(const Rig& rig, std::span<const Detection> detections, const BoardSpec& board,
                          const CheckOptions& options) {
  if (auto ok = check_input(rig, detections, board); !ok) return tl::unexpected(ok.error());
  Bundle bundle;
  bundle.cameras = bundle.known = rig.cameras;
  bundle.focal_known.assign(rig.cameras.size(), true);
  bundle.board_mm = corners_mm(board);
  std::vector<std::string> poses;
  for (const Detection& d : detections) {
    if (d.found() && std::ranges::find(poses, d.pose) == poses.end()) poses.push_back(d.pose);
  }
  for (const std::string& pose : poses) {
    std::vector<const Detection*> seen;
    for (const Detection& d : detections) {
      if (d.found() && d.pose == pose) seen.push_back(&d);
    }
    if (seen.size() < 3) continue;
    const std::size_t at = bundle.world_from_board.size();
    bundle.world_from_board.emplace_back();
    for (const Detection* d : seen) {
      bundle.views.push_back(
          {*rig.find(d->camera), at, d->corners_px, std::vector<bool>(board.corners(), true)});
    }
    if (const auto agreed = agreed_pose(bundle, at, seen, board)) {
      bundle.world_from_board[at] = *agreed;
      for (BundleView& view : bundle.views)
        if (view.pose == at) view = best_turned(bundle, view, look_alike_turns(board));
    } else {
      bundle.world_from_board.pop_back();
      std::erase_if(bundle.views, [&](const BundleView& view) { return view.pose == at; });
    }
  }
  if (bundle.views.empty()) {
    return invalid_input("no board pose was seen by three cameras", "two cannot tell which of them has moved",
                         "show the board to more cameras at once");
  }

  std::vector<bool> moved(rig.cameras.size(), false);
  CheckReport report;
  for (int round = 0; round < 2; ++round) {
    place_boards(bundle, moved);
    report.cameras = judge(bundle, options);
    for (std::size_t c = 0; c < moved.size(); ++c) moved[c] = report.cameras[c].moved;
  }
  double sum = 0;
  int corners = 0;
  for (const CameraCheck& camera : report.cameras) {
    if (camera.moved) report.moved.push_back(camera.camera);
    if (camera.corners == 0) report.unseen.push_back(camera.camera);
    if (camera.moved || camera.corners == 0) continue;
    sum += camera.rms_px * camera.rms_px * camera.corners;
    corners += camera.corners;
  }
  report.rms_px = corners > 0 ? std::sqrt(sum / corners) : 0;
  return report;
}

}  // namespace flamefield
