#include "calibrate/sightings.h"

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace flamefield {

namespace {

std::size_t number_of(const std::string& name, std::vector<std::string>& names,
                      std::map<std::string, std::size_t>& numbers) {
  const auto [at, is_new] = numbers.try_emplace(name, names.size());
  if (is_new) names.push_back(name);
  return at->second;
}

Result<> check_view(const Detection& view, const Detection& first_of_camera, const BoardSpec& board) {
  if (view.image_width_px != first_of_camera.image_width_px ||
      view.image_height_px != first_of_camera.image_height_px) {
    return invalid_input(concat("camera ", view.camera, ": pose ", view.pose, " is ", view.image_width_px,
                                "x", view.image_height_px, " px, pose ", first_of_camera.pose, " is ",
                                first_of_camera.image_width_px, "x", first_of_camera.image_height_px),
                         "one lens model holds for one image size",
                         "take all images with the same region of interest");
  }
  if (view.found() && view.corners_px.size() != board.corners()) {
    return invalid_input(
        concat("camera ", view.camera, ", pose ", view.pose, ": ", view.corners_px.size(), " corners"),
        concat("the board has ", board.cols, "x", board.rows), "check --board");
  }
  const bool may_miss = board.kind == BoardKind::Charuco;
  const bool good = std::ranges::all_of(
      view.corners_px, [&](const auto& p) { return is_seen(p) || (may_miss && p.array().isNaN().all()); });
  if (!good) {
    return invalid_input(concat("camera ", view.camera, ", pose ", view.pose, ": a corner is not a number"),
                         "pixels must be finite", "detect the board again");
  }
  return {};
}

// An earlier view of the camera with the same corners to the last digit: noise makes that impossible.
const Detection* find_copy(const Sightings& sightings, std::size_t camera, const Detection& detection) {
  if (!detection.found()) return nullptr;
  const auto is_same = [](const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
    return a == b || (!is_seen(a) && !is_seen(b));
  };
  for (const Sightings::View& view : sightings.views) {
    if (view.camera == camera && view.detection != &detection &&
        std::ranges::equal(view.detection->corners_px, detection.corners_px, is_same))
      return view.detection;
  }
  return nullptr;
}

// Some pose is seen.
Result<std::size_t> find_reference(const Sightings& sightings, const std::string& name) {
  const auto is_seen = [&](std::size_t pose) {
    return std::ranges::any_of(sightings.views, [&](const Sightings::View& view) {
      return view.pose == pose && view.detection->found();
    });
  };
  std::size_t reference = 0;
  if (name.empty()) {
    while (!is_seen(reference)) ++reference;
    return reference;
  }
  const auto at = std::ranges::find(sightings.poses, name);
  if (at == sightings.poses.end()) {
    return invalid_input(concat("reference pose '", name, "'"), "no image has this name",
                         concat("name one of the board poses, e.g. ", sightings.poses.front()));
  }
  reference = static_cast<std::size_t>(at - sightings.poses.begin());
  if (!is_seen(reference)) {
    return invalid_input(concat("reference pose '", name, "' was seen by no camera"),
                         "it fixes the world frame", "turn the board on the burner towards the cameras");
  }
  return reference;
}

}  // namespace

std::vector<const Detection*> Sightings::found_by(std::size_t camera) const {
  std::vector<const Detection*> found;
  for (const View& view : views) {
    if (view.camera == camera && view.detection->found()) found.push_back(view.detection);
  }
  return found;
}

namespace {

std::string commonest_reason(std::span<const Detection> detections) {
  std::map<std::string, int> count;
  for (const Detection& d : detections) ++count[d.reason];
  const auto most = std::ranges::max_element(count, {}, [](const auto& entry) { return entry.second; });
  return most == count.end() ? "" : concat("; ", most->second, " times: ", most->first);
}

}  // namespace

Result<Sightings> sight(std::span<const Detection> detections, const BoardSpec& board,
                        const CalibrationOptions& options) {
  Sightings out;
  std::map<std::string, std::size_t> camera_numbers, pose_numbers;
  std::map<std::size_t, const Detection*> first_of_camera;
  std::set<std::pair<std::size_t, std::size_t>> taken;
  std::set<std::size_t> seen_poses;
  for (const std::string& camera : options.cameras) number_of(camera, out.cameras, camera_numbers);
  for (const Detection& detection : detections) {
    const std::size_t camera = number_of(detection.camera, out.cameras, camera_numbers);
    const std::size_t pose = number_of(detection.pose, out.poses, pose_numbers);
    if (!taken.insert({camera, pose}).second) {
      return invalid_input(concat("camera ", detection.camera, " has two images of pose ", detection.pose),
                           "one image each", "give every board pose its own name");
    }
    const Detection& first = *first_of_camera.try_emplace(camera, &detection).first->second;
    if (auto ok = check_view(detection, first, board); !ok) return tl::unexpected(ok.error());
    out.views.push_back({camera, pose, &detection});
    if (const Detection* same = find_copy(out, camera, detection)) {
      Detection& replaced = out.replaced.emplace_back(detection);
      replaced.corners_px.clear();
      replaced.reason = concat("same picture as ", same->pose);
      out.views.back().detection = &replaced;
    }
    if (out.views.back().detection->found()) seen_poses.insert(pose);
  }
  if (seen_poses.empty()) {
    return invalid_input(
        concat("no board in any of ", detections.size(), " images"),
        concat("looked for ", board.cols, "x", board.rows, " inner corners", commonest_reason(detections)),
        "check --board, focus and light");
  }
  if (seen_poses.size() < 2) {
    return invalid_input("only one board pose was seen", "cameras and lenses need several orientations",
                         "take 20 poses or more");
  }
  auto reference = find_reference(out, options.reference_pose);
  if (!reference) return tl::unexpected(reference.error());
  out.reference = *reference;
  return out;
}

}  // namespace flamefield
