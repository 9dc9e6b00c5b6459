#include "services/calibration/output.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>

#include "proto/version.h"
#include "services/report/calibration_data.h"
#include "services/store/file.h"

namespace flamefield {

namespace {

double degrees(double angle_rad) {
  return angle_rad * 180 / std::numbers::pi;
}

nlohmann::json json_of(const VolumeError& error) {
  return {{"mean", error.mean_px}, {"worst", error.worst_px}, {"camera", error.worst_camera}};
}

nlohmann::json json_of(const Camera& camera, const CameraQuality& q) {
  return {{"name", camera.name},
          {"images", q.images},
          {"corners", q.corners},
          {"rejected", q.rejected_corners},
          {"rms_px", q.rms_px},
          {"f_px", camera.fx_px},
          {"sigma",
           {{"f_px", q.focal_sigma_px},
            {"position_mm", q.position_sigma_mm},
            {"rotation_rad", q.rotation_sigma_rad}}}};
}

nlohmann::json views_json(const CalibrationReport& report) {
  nlohmann::json views = nlohmann::json::array();
  for (const ViewReport& view : report.views) {
    nlohmann::json out = {{"camera", view.camera}, {"pose", view.pose}, {"used", view.is_used()}};
    if (view.is_used()) {
      out["rms_px"] = view.rms_px;
      out["rejected"] = view.rejected;
      if (view.turned) out["turned"] = true;
    } else {
      out["reason"] = view.reason;
    }
    views.push_back(out);
  }
  return views;
}

nlohmann::json links_json(const CalibrationReport& report) {
  nlohmann::json links = nlohmann::json::array();
  for (const MissingLink& link : report.missing_links)
    links.push_back({{"connected", link.connected}, {"loose", link.loose}});
  return links;
}

}  // namespace

std::string json_text(const CalibrationReport& report) {
  nlohmann::json cameras = nlohmann::json::array(), pairs = nlohmann::json::array();
  for (std::size_t i = 0; i < report.rig.cameras.size(); ++i)
    cameras.push_back(json_of(report.rig.cameras[i], report.rig.quality->cameras[i]));
  for (const SharedPoses& pair : report.pairs)
    pairs.push_back({{"a", pair.a}, {"b", pair.b}, {"poses", pair.poses}});
  nlohmann::json json = {{"rms_px", report.rms_px},
                         {"sigma_px", report.sigma_px},
                         {"corners", report.corners},
                         {"rejected", report.rejected_corners},
                         {"cameras", cameras},
                         {"pairs", pairs},
                         {"connected", report.connected},
                         {"unconnected", report.unconnected},
                         {"missing_links", links_json(report)},
                         {"turned_views", report.turned_views},
                         {"pictures", views_json(report)},
                         {"volume_error_px", json_of(report.expected_volume_error)},
                         {"volume_error_mm", report.expected_volume_error_mm},
                         {"verdict", name_of(verdict_of(report.expected_volume_error))},
                         {"clustering", report.clustering},
                         {"coverage", {{"image", report.coverage.image}, {"volume", report.coverage.volume}}},
                         {"board_bow_mm", {report.bow_mm.x(), report.bow_mm.y()}},
                         {"converged", report.converged},
                         {"wall_s", report.seconds},
                         {"split_half", nullptr}};
  if (report.split_half) {
    json["split_half"] = {{"rotation_deg", degrees(report.split_half->rotation_rad)},
                          {"translation_mm", report.split_half->translation_mm}};
  }
  return json.dump(2) + "\n";
}

std::string json_text(const CheckReport& report) {
  nlohmann::json cameras = nlohmann::json::array();
  for (const CameraCheck& camera : report.cameras) {
    cameras.push_back({{"name", camera.camera},
                       {"images", camera.images},
                       {"corners", camera.corners},
                       {"rms_px", camera.rms_px},
                       {"mean_px", {camera.mean_px.x(), camera.mean_px.y()}},
                       {"moved", camera.moved}});
  }
  return nlohmann::json{{"cameras", cameras},
                        {"moved", report.moved},
                        {"unseen", report.unseen},
                        {"rms_px", report.rms_px}}
             .dump(2) +
         "\n";
}

std::string json_text(const FlameCheck& check) {
  nlohmann::json cameras = nlohmann::json::array();
  for (const FlameDrift& camera : check.cameras) {
    cameras.push_back({{"name", camera.camera},
                       {"shift_px", {camera.shift_px.x(), camera.shift_px.y()}},
                       {"moved", camera.moved}});
  }
  return nlohmann::json{{"cameras", cameras}, {"moved", check.moved}, {"typical_px", check.typical_px}}.dump(
             2) +
         "\n";
}

std::string json_text(const CalibrationState& state) {
  nlohmann::json cameras = nlohmann::json::array(), links = nlohmann::json::array();
  for (const auto& camera : state.cameras) {
    nlohmann::json out = {{"name", camera.name},
                          {"sees_board", camera.sees_board},
                          {"last_reason", camera.last_reason},
                          {"corners_px", camera.corners_px},
                          {"boards", camera.boards},
                          {"coverage", camera.coverage},
                          {"covered", camera.covered},
                          {"region_px", camera.region_px},
                          {"expected_px", nullptr},
                          {"shift_px", nullptr},
                          {"moved", camera.moved}};
    if (camera.expected_px >= 0) out["expected_px"] = camera.expected_px;
    if (camera.shift_px >= 0) out["shift_px"] = camera.shift_px;
    cameras.push_back(std::move(out));
  }
  for (const auto& link : state.links_missing) links.push_back({{"a", link.a}, {"b", link.b}});
  return nlohmann::json{{"state", name_of(state.phase)},
                        {"session", state.id},
                        {"automatic", state.automatic},
                        {"poses", state.poses},
                        {"wanted_poses", state.wanted_poses},
                        {"still", state.still},
                        {"new", state.is_new},
                        {"message", state.message},
                        {"error", state.error},
                        {"cameras", std::move(cameras)},
                        {"needed", state.needed},
                        {"links_missing", std::move(links)},
                        {"volume_coverage", state.volume_coverage},
                        {"verdict", state.verdict},
                        {"rms_px", state.rms_px},
                        {"volume_error_px",
                         {{"mean", state.volume_mean_px},
                          {"worst", state.volume_worst_px},
                          {"camera", state.worst_camera}}},
                        {"previous_version", state.previous_version},
                        {"moved_cameras", state.moved},
                        {"accepted_version", state.accepted_version},
                        {"report", state.report},
                        {"board", state.board}}
             .dump(2) +
         "\n";
}

std::string json_text(const Calibration& c) {
  return nlohmann::json{
             {"version", c.version},
             {"predecessor", c.predecessor == 0 ? nlohmann::json() : nlohmann::json(c.predecessor)},
             {"rig_id", c.rig_id},
             {"accepted_time_ns", c.accepted_time_ns},
             {"accepted_by", c.accepted_by},
             {"note", c.note},
             {"capture", c.capture},
             {"poses", c.poses},
             {"rms_px", c.rms_px},
             {"volume_error_px",
              {{"mean", c.volume_mean_px}, {"worst", c.volume_worst_px}, {"camera", c.worst_camera}}},
             {"verdict", c.verdict},
             {"moved_cameras", c.moved},
             {"worst_shift_px", c.worst_shift_px < 0 ? nlohmann::json() : nlohmann::json(c.worst_shift_px)},
             {"most_shifted", c.most_shifted}}
             .dump(2) +
         "\n";
}

std::string split_half_text(const CalibrationReport& report) {
  if (!report.split_half) return "none (too few poses)";
  return fmt::format("{:.4f} deg, {:.3f} mm, {:.3f} px in the volume",
                     degrees(report.split_half->rotation_rad), report.split_half->translation_mm,
                     report.split_half->volume.mean_px);
}

namespace {

std::string board_text(const BoardSpec& board) {
  return fmt::format("{} of {}x{} inner corners, squares of {} mm{}", name_of(board.kind), board.cols,
                     board.rows, board.square_mm,
                     board.kind == BoardKind::Charuco
                         ? fmt::format(", markers {} of {} mm", board.dictionary, board.marker_mm)
                         : "");
}

// Of the pictures that were used, those with the largest residuals; at most one a camera.
std::vector<ReportOverlay> worst_pictures(const CalibrationReport& report, std::span<const BoardView> views) {
  std::vector<const ViewReport*> used;
  for (const ViewReport& view : report.views)
    if (view.is_used()) used.push_back(&view);
  std::ranges::sort(used, std::greater<>(), &ViewReport::rms_px);
  std::vector<ReportOverlay> out;
  constexpr std::size_t kShown = 6;
  for (const ViewReport* view : used) {
    if (out.size() == kShown) break;
    if (std::ranges::find(out, view->camera, &ReportOverlay::camera) != out.end()) continue;
    const auto picture = std::ranges::find_if(
        views, [&](const BoardView& v) { return v.camera == view->camera && v.pose == view->pose; });
    if (picture != views.end()) out.push_back({view->camera, view->pose, picture->image});
  }
  return out;
}

// The frame that all positions refer to, in words.
std::string world_text(const CalibrationReport& report) {
  const auto at = std::find(report.poses.begin(), report.poses.end(), report.reference_pose);
  const auto& board = report.world_from_board[static_cast<std::size_t>(at - report.poses.begin())];
  if (!board) return concat("from pose ", report.reference_pose);
  const Eigen::Vector3d centre = board->translation_mm, face = -board->rotation.col(2);
  return fmt::format(
      "mm, y up, origin at the burner's exit; fixed by pose {}, whose board is stated to have its middle at "
      "({:.4g}, {:.4g}, {:.4g}) mm and to face azimuth {:.4g} deg",
      report.reference_pose, centre.x(), centre.y(), centre.z(), degrees(std::atan2(face.z(), face.x())));
}

}  // namespace

Result<> write_calibration_report(const std::filesystem::path& folder, const CalibrationReport& report,
                                  const CalibrationContext& context) {
  if (auto ok = write_text_file(folder / "calibration.json", json_text(report)); !ok) return ok;
  ReportData page;
  page.title = "Calibration of the ring";
  page.subtitle = fmt::format("{} cameras, {} board poses", report.rig.cameras.size(), report.poses.size());
  page.created = fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)));
  page.calibration = report_calibration(report);
  if (context.comparison)
    page.calibration->comparison = std::make_shared<const RigComparison>(*context.comparison);
  page.calibration->compared_with = context.compared_with;
  page.calibration->overlays = worst_pictures(report, context.views);
  page.parameters = {
      {"program", concat("flamefield ", program_version())},
      {"board", board_text(context.board)},
      {"world frame", world_text(report)},
      {"corners", fmt::format("{} used, {} rejected", report.corners, report.rejected_corners)},
      {"two calibrations from half of the poses each differ by", split_half_text(report)},
      {"adjustment", fmt::format("{}, {} iterations", report.stop_reason, report.iterations)}};
  page.commands = {context.command_line};
  return write_report(folder / "report.html", page);
}

}  // namespace flamefield
