#include "services/cli/calibration_output.h"

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>
#include <map>
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

std::string split_half_text(const CalibrationReport& report) {
  if (!report.split_half) return "none (too few poses)";
  return fmt::format("{:.4f} deg, {:.3f} mm, {:.3f} px in the volume",
                     degrees(report.split_half->rotation_rad), report.split_half->translation_mm,
                     report.split_half->volume.mean_px);
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

void print(const CalibrationReport& report, const std::filesystem::path& rig) {
  fmt::print("{:<12} {:>7} {:>8} {:>9} {:>8} {:>9}\n", "camera", "images", "corners", "rejected", "RMS px",
             "f px");
  for (std::size_t i = 0; i < report.rig.cameras.size(); ++i) {
    const CameraQuality& q = report.rig.quality->cameras[i];
    fmt::print("{:<12} {:>7} {:>8} {:>9} {:>8.3f} {:>9.1f}\n", report.rig.cameras[i].name, q.images,
               q.corners, q.rejected_corners, q.rms_px, report.rig.cameras[i].fx_px);
  }
  std::map<std::string, int> reasons;
  for (const ViewReport& view : report.views)
    if (!view.is_used()) ++reasons[view.reason.substr(0, view.reason.find_first_of(":("))];
  for (const auto& [reason, count] : reasons)
    fmt::print("{} of {} images: {}\n", count, report.views.size(), reason);
  if (report.turned_views > 0)
    fmt::print("{} images renumbered: the board looks the same from its other end\n", report.turned_views);
  for (const MissingLink& link : report.missing_links)
    fmt::print("not connected: show the board to {} and {} at once\n", link.connected, link.loose);
  if (report.bow_sigma_mm.norm() > 0) {
    fmt::print("board bow {:.3f} +- {:.3f} mm along columns, {:.3f} +- {:.3f} mm along rows\n",
               report.bow_mm.x(), report.bow_sigma_mm.x(), report.bow_mm.y(), report.bow_sigma_mm.y());
  }
  const VolumeError& error = report.expected_volume_error;
  fmt::print("{}: RMS {:.3f} px, expected error in the volume {:.3f} px, worst {:.3f} px ({}): {}\n",
             rig.string(), report.rms_px, error.mean_px, error.worst_px, error.worst_camera,
             name_of(verdict_of(error)));
}

void print(const CheckReport& report) {
  fmt::print("{:<12} {:>7} {:>8} {:>8} {:>9} {:>9}\n", "camera", "images", "corners", "RMS px", "dx px",
             "dy px");
  for (const CameraCheck& camera : report.cameras) {
    if (camera.corners == 0) {
      fmt::print("{:<12} saw no board: nothing is known about it\n", camera.camera);
      continue;
    }
    fmt::print("{:<12} {:>7} {:>8} {:>8.3f} {:>9.3f} {:>9.3f}{}\n", camera.camera, camera.images,
               camera.corners, camera.rms_px, camera.mean_px.x(), camera.mean_px.y(),
               camera.moved ? "  moved" : "");
  }
  fmt::print("{} of {} cameras have moved; the others agree with the rig to {:.3f} px RMS\n",
             report.moved.size(), report.cameras.size() - report.unseen.size(), report.rms_px);
}

Result<> write_calibration_report(const std::filesystem::path& folder, const CalibrationReport& report,
                                  const BoardSpec& board, const std::string& command_line) {
  if (auto ok = write_text_file(folder / "calibration.json", json_text(report)); !ok) return ok;
  ReportData page;
  page.title = "Calibration of the ring";
  page.subtitle = fmt::format("{} cameras, {} board poses", report.rig.cameras.size(), report.poses.size());
  page.created = fmt::format("{:%Y-%m-%d %H:%M:%S} UTC", fmt::gmtime(std::time(nullptr)));
  page.calibration = report_calibration(report);
  page.parameters = {
      {"program", concat("flamefield ", program_version())},
      {"board",
       fmt::format("{}x{} inner corners, squares of {} mm", board.cols, board.rows, board.square_mm)},
      {"reference pose", report.reference_pose},
      {"corners", fmt::format("{} used, {} rejected", report.corners, report.rejected_corners)},
      {"two calibrations from half of the poses each differ by", split_half_text(report)},
      {"adjustment", fmt::format("{}, {} iterations", report.stop_reason, report.iterations)}};
  page.commands = {command_line};
  return write_report(folder / "report.html", page);
}

}  // namespace flamefield
