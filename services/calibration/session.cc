#include "services/calibration/session.h"

#include <algorithm>
#include <cstdio>

#include "calibrate/detect.h"

namespace flamefield {

namespace {

constexpr const char* kReference = "pose000";

std::string pose_name(int number) {
  char text[16];
  std::snprintf(text, sizeof text, "pose%03d", number);
  return text;
}

std::string words(const BoardSpec& board) {
  return concat(board.cols, "x", board.rows, " ", name_of(board.kind), ", squares of ", board.square_mm,
                " mm");
}

void describe(const Detection& seen, CalibrationState::CameraState& camera) {
  camera.sees_board = seen.found();
  camera.last_reason = seen.reason;
  for (const Eigen::Vector2d& corner : seen.corners_px) {
    if (!is_seen(corner)) continue;
    camera.corners_px.push_back(corner.x());
    camera.corners_px.push_back(corner.y());
  }
}

void describe(const CameraGuide& guide, CalibrationState::CameraState& camera) {
  camera.boards = guide.boards;
  camera.coverage = guide.coverage;
  camera.covered.assign(guide.covered.begin(), guide.covered.end());
  const ImageRegion& r = guide.region;
  camera.region_px = {r.left_px, r.top_px, r.width_px, r.height_px};
}

}  // namespace

CalibrationSession::CalibrationSession(CalibrationSessionOptions options) : options_(std::move(options)) {}

Result<> CalibrationSession::look(const FrameSet& set) {
  std::vector<BoardView> views;
  for (const Frame& frame : set.frames) {
    if (std::ranges::find(options_.cameras, frame.camera) == options_.cameras.end()) continue;
    auto image = grey_levels(frame);
    if (!image) return tl::unexpected(image.error());
    views.push_back({frame.camera, "newest", std::move(*image)});
  }
  is_still_ = follow(views);
  if (!is_still_) {
    auto found = detect(views, options_.board, {.threads = options_.threads});
    if (!found) return tl::unexpected(found.error());
    seen_ = std::move(*found);
  }
  is_new_ = is_new_pose(seen_, taken_, options_.new_px);
  return {};
}

// Whether every camera that saw the board sees it in the same place; its corners are then brought up to date.
// Cameras that did not see it are not asked again while it rests.
bool CalibrationSession::follow(std::span<const BoardView> views) {
  std::vector<Detection> now;
  for (const Detection& before : seen_) {
    if (!before.found()) {
      now.push_back(before);
      continue;
    }
    const auto view = std::ranges::find(views, before.camera, &BoardView::camera);
    if (view == views.end()) return false;
    auto tracked = track_board(*view, before, options_.board);
    if (!tracked) return false;
    const auto moved_px = displacement_px(*tracked, before);
    if (!moved_px || *moved_px > options_.still_px) return false;
    now.push_back(std::move(*tracked));
  }
  // A camera whose picture was lost last time has not been asked at all.
  const auto is_known = [&](const BoardView& view) {
    return std::ranges::find(now, view.camera, &Detection::camera) != now.end();
  };
  if (!std::ranges::any_of(now, &Detection::found) || !std::ranges::all_of(views, is_known)) return false;
  seen_ = std::move(now);
  return true;
}

bool CalibrationSession::is_worth_taking() const {
  const auto cameras = std::ranges::count_if(seen_, &Detection::found);
  return is_still_ && is_new_ && cameras >= (poses_ == 0 ? 1 : 2);
}

Result<std::string> CalibrationSession::take() {
  if (!std::ranges::any_of(seen_, &Detection::found)) {
    return invalid_input("pose not taken", "no camera sees the board", "turn it towards the cameras");
  }
  const std::string name = pose_name(poses_++);
  for (Detection seen : seen_) {
    seen.pose = name;
    taken_.push_back(std::move(seen));
  }
  is_new_ = false;
  report_.reset();
  comparison_.reset();
  return name;
}

void CalibrationSession::solve_roughly() {
  constexpr int kEnough = 4;  // poses
  if (poses_ < kEnough) return;
  CalibrationOptions solving = options_.solving;
  solving.cameras = options_.cameras;
  solving.reference_pose = kReference;
  solving.require_connected = false;
  solving.split_half = false;
  if (auto report = calibrate(taken_, options_.board, solving)) rough_ = std::move(*report);
}

Result<> CalibrationSession::solve() {
  CalibrationOptions solving = options_.solving;
  solving.cameras = options_.cameras;
  solving.reference_pose = kReference;
  auto report = calibrate(taken_, options_.board, solving);
  if (!report) return tl::unexpected(report.error());
  report_ = std::move(*report);
  rough_ = report_;
  comparison_.reset();
  if (options_.previous) {
    // Rigs of other cameras have nothing to say to each other.
    if (auto found = compare_rigs(report_->rig, options_.previous->rig, options_.solving.volume))
      comparison_ = std::move(*found);
  }
  return {};
}

void CalibrationSession::describe(CalibrationState& state) const {
  GuideOptions guiding;
  guiding.cameras = options_.cameras;
  guiding.wanted_poses = options_.wanted_poses;
  const Guidance guidance = guide(taken_, guiding, rough_ ? &*rough_ : nullptr);
  state.board = words(options_.board);
  state.wanted_poses = options_.wanted_poses;
  state.poses = poses_;
  state.still = is_still_;
  state.is_new = is_new_;
  state.cameras.clear();
  for (const CameraGuide& of_camera : guidance.cameras) {
    CalibrationState::CameraState& camera = state.cameras.emplace_back();
    camera.name = of_camera.camera;
    flamefield::describe(of_camera, camera);
    const auto seen = std::ranges::find(seen_, of_camera.camera, &Detection::camera);
    if (seen != seen_.end())
      flamefield::describe(*seen, camera);
    else
      camera.last_reason = "no picture";
    if (rough_) {
      const auto at = rough_->rig.find(camera.name);
      if (at && *at < rough_->camera_volume_px.size()) camera.expected_px = rough_->camera_volume_px[*at];
    }
    if (!comparison_) continue;
    const auto shift = std::ranges::find(comparison_->cameras, camera.name, &CameraShift::camera);
    if (shift == comparison_->cameras.end()) continue;
    camera.shift_px = shift->shift_px;
    camera.moved = shift->moved;
  }
  state.needed = guidance.needed;
  state.links_missing.clear();
  for (const MissingLink& link : guidance.links_missing)
    state.links_missing.push_back({link.connected, link.loose});
  state.volume_coverage = rough_ ? rough_->coverage.volume : 0;
  state.previous_version = comparison_ ? options_.previous->version : 0;
  state.moved = comparison_ ? comparison_->moved : std::vector<std::string>();
  state.verdict.clear();
  const CalibrationReport* solution = report_ ? &*report_ : rough_ ? &*rough_ : nullptr;
  if (!solution) return;
  const VolumeError& error = solution->expected_volume_error;
  state.rms_px = solution->rms_px;
  state.volume_mean_px = error.mean_px;
  state.volume_worst_px = error.worst_px;
  state.worst_camera = error.worst_camera;
  if (solution->connected) state.verdict = name_of(verdict_of(error));
}

}  // namespace flamefield
