#include "calibrate/guide.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include "calibrate/median.h"

namespace flamefield {

namespace {

constexpr const char* kFieldNames[9] = {"upper left", "upper middle", "upper right",  "left",       "centre",
                                        "right",      "lower left",   "lower middle", "lower right"};

// Half as large again as the picture of the measuring volume, where the camera's place is known.
ImageRegion region_of(const std::string& camera, const Detection* picture,
                      const CalibrationReport* solution) {
  if (solution) {
    if (const auto at = solution->rig.find(camera)) {
      const Camera& known = solution->rig.cameras[*at];
      Eigen::Vector2d low(1e9, 1e9), high(-1e9, -1e9);
      for (const Eigen::Vector3d& point : points_of(solution->volume)) {
        const auto pixel = project(known, point);
        if (!pixel) continue;
        low = low.cwiseMin(*pixel);
        high = high.cwiseMax(*pixel);
      }
      const Eigen::Vector2d size(known.image_width_px, known.image_height_px), grow = 0.25 * (high - low);
      low = (low - grow).cwiseMax(0).cwiseMin(size);
      high = (high + grow).cwiseMax(0).cwiseMin(size);
      if ((high - low).minCoeff() > 0) return {low.x(), low.y(), high.x() - low.x(), high.y() - low.y()};
    }
  }
  if (!picture) return {};
  const double w = picture->image_width_px, h = picture->image_height_px;
  return {0.25 * w, 0.25 * h, 0.5 * w, 0.5 * h};
}

void cover(CameraGuide& camera, const Detection& view) {
  for (const Eigen::Vector2d& p : view.corners_px) {
    if (!is_seen(p)) continue;
    const double x = 3 * (p.x() - camera.region.left_px) / camera.region.width_px,
                 y = 3 * (p.y() - camera.region.top_px) / camera.region.height_px;
    if (x < 0 || y < 0 || x >= 3 || y >= 3) continue;
    camera.covered[static_cast<std::size_t>(3 * static_cast<int>(y) + static_cast<int>(x))] = true;
  }
}

CameraGuide guide_of(const std::string& name, std::span<const Detection> taken,
                     const CalibrationReport* solution) {
  CameraGuide out{name, 0, {}, {}, 0};
  const auto first = std::ranges::find(taken, name, &Detection::camera);
  out.region = region_of(name, first == taken.end() ? nullptr : &*first, solution);
  for (const Detection& view : taken) {
    if (view.camera != name || !view.found()) continue;
    ++out.boards;
    if (out.region.width_px > 0) cover(out, view);
  }
  out.coverage = static_cast<double>(std::ranges::count(out.covered, true)) / 9;
  return out;
}

// Groups of cameras that poses tie together; each group but the largest is joined to it, or to one that is
// already joined, where neighbours meet.
std::vector<MissingLink> links_between(std::span<const Detection> taken,
                                       const std::vector<std::string>& cameras) {
  std::vector<std::size_t> part(cameras.size());
  std::iota(part.begin(), part.end(), 0u);
  const auto merge = [&](std::size_t a, std::size_t b) {
    const std::size_t from = part[a], to = part[b];
    for (std::size_t& p : part) p = p == from ? to : p;
  };
  std::map<std::string, std::size_t> first_to_see;  // of each pose
  for (const Detection& view : taken) {
    const auto camera = static_cast<std::size_t>(std::ranges::find(cameras, view.camera) - cameras.begin());
    if (view.found() && camera < cameras.size())
      merge(camera, first_to_see.try_emplace(view.pose, camera).first->second);
  }
  if (first_to_see.empty()) return {};
  std::map<std::size_t, int> sizes;
  for (std::size_t p : part) ++sizes[p];
  const std::size_t home =
      std::ranges::max_element(sizes, {}, [](const auto& entry) { return entry.second; })->first;
  std::vector<MissingLink> links;
  for (;;) {
    std::optional<std::pair<std::size_t, std::size_t>> best;  // joined, loose
    const auto apart = [](std::size_t a, std::size_t b) { return a > b ? a - b : b - a; };
    for (std::size_t a = 0; a < cameras.size(); ++a) {
      for (std::size_t b = 0; b < cameras.size(); ++b) {
        if (part[a] != home || part[b] == home) continue;
        if (!best || apart(a, b) < apart(best->first, best->second)) best = {a, b};
      }
    }
    if (!best) return links;
    links.push_back({cameras[best->first], cameras[best->second]});
    const std::size_t from = part[best->second];
    for (std::size_t& p : part) p = p == from ? home : p;
  }
}

// "upper left and lower left"
std::string missing_fields(const CameraGuide& camera) {
  std::string out;
  int named = 0;
  for (std::size_t i = 0; i < 9 && named < 2; ++i) {
    if (camera.covered[i]) continue;
    out += concat(named > 0 ? " and the " : "", kFieldNames[i]);
    ++named;
  }
  return out;
}

// Cameras whose pictures foretell the measuring volume worst, worst first.
std::vector<std::pair<double, std::string>> uncertain(const CalibrationReport& solution, double wanted_px) {
  std::vector<std::pair<double, std::string>> out;
  for (std::size_t c = 0; c < solution.camera_volume_px.size(); ++c) {
    const double error = solution.camera_volume_px[c];
    if (error > wanted_px) out.emplace_back(error, solution.rig.cameras[c].name);
  }
  std::ranges::sort(out, std::greater<>());
  return out;
}

std::string hundredths(double value) {
  return concat(std::round(100 * value) / 100);
}

}  // namespace

Guidance guide(std::span<const Detection> taken, const GuideOptions& options,
               const CalibrationReport* solution) {
  Guidance out;
  std::set<std::string> poses;
  for (const Detection& view : taken) poses.insert(view.pose);
  for (const std::string& camera : options.cameras) out.cameras.push_back(guide_of(camera, taken, solution));
  if (poses.empty()) {
    out.needed.push_back("put the board into its holder on the burner: it fixes the world frame");
    return out;
  }
  out.links_missing = links_between(taken, options.cameras);
  for (const MissingLink& link : out.links_missing)
    out.needed.push_back(concat("show the board to ", link.connected, " and ", link.loose, " at once"));
  for (const CameraGuide& camera : out.cameras) {
    if (camera.boards >= options.wanted_boards) continue;
    out.needed.push_back(concat("tilt the board towards ", camera.camera, " (", camera.boards, " of ",
                                options.wanted_boards, " pictures)"));
  }
  if (solution) {
    for (const auto& [error, camera] : uncertain(*solution, options.wanted_error_px))
      out.needed.push_back(concat("tilt the board towards ", camera, " (it is uncertain by ",
                                  hundredths(error), " px in the measuring volume)"));
    if (solution->coverage.volume < options.wanted_volume)
      out.needed.push_back(concat("move the board through more of the measuring volume (",
                                  std::lround(100 * solution->coverage.volume), " % of it so far)"));
  }
  for (const CameraGuide& camera : out.cameras) {
    if (camera.boards < options.wanted_boards || camera.coverage >= 7.0 / 9 - 1e-9) continue;
    out.needed.push_back(concat("cover the ", missing_fields(camera), " of ", camera.camera));
  }
  const int more = options.wanted_poses - static_cast<int>(poses.size());
  if (more > 0) out.needed.push_back(concat("take ", more, more == 1 ? " more pose" : " more poses"));
  return out;
}

std::optional<double> displacement_px(const Detection& a, const Detection& b) {
  if (!a.found() || a.corners_px.size() != b.corners_px.size()) return std::nullopt;
  double sum = 0;
  int shared = 0;
  for (std::size_t i = 0; i < a.corners_px.size(); ++i) {
    if (!is_seen(a.corners_px[i]) || !is_seen(b.corners_px[i])) continue;
    sum += (a.corners_px[i] - b.corners_px[i]).squaredNorm();
    ++shared;
  }
  constexpr int kEnough = 4;
  if (shared < kEnough) return std::nullopt;
  return std::sqrt(sum / shared);
}

bool is_new_pose(std::span<const Detection> seen, std::span<const Detection> taken, double limit_px) {
  std::map<std::string, std::map<std::string, const Detection*>> before;  // by pose and camera
  for (const Detection& view : taken) before[view.pose][view.camera] = &view;
  const auto differs = [&](const auto& pose) {
    return std::ranges::any_of(seen, [&](const Detection& view) {
      if (!view.found()) return false;
      const auto then = pose.second.find(view.camera);
      if (then == pose.second.end()) return true;
      const auto moved = displacement_px(view, *then->second);
      return !moved || *moved > limit_px;
    });
  };
  const bool any = std::ranges::any_of(seen, &Detection::found);
  return any && std::ranges::all_of(before, differs);
}

}  // namespace flamefield
