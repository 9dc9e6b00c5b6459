#include "calibrate/connect.h"

#include <algorithm>

#include "calibrate/median.h"
#include "calibrate/start.h"

namespace flamefield {

namespace {

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

}  // namespace

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
  std::vector<std::size_t> camera_at(sightings.cameras.size(), kNotSolved),
      pose_at(sightings.poses.size(), kNotSolved);
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
    out.bundle_view.push_back(kNotSolved);
    if (!posed[v] || camera_at[view.camera] == kNotSolved || pose_at[view.pose] == kNotSolved) continue;
    out.bundle_view.back() = out.bundle.views.size();
    std::vector<bool> used;
    for (const Eigen::Vector2d& corner : view.detection->corners_px) used.push_back(is_seen(corner));
    out.bundle.views.push_back(
        {camera_at[view.camera], pose_at[view.pose], view.detection->corners_px, std::move(used)});
  }
  return out;
}

}  // namespace flamefield
