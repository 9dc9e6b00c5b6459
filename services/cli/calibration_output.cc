#include "services/cli/calibration_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "services/calibration/output.h"

namespace flamefield {

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

void print(const FlameCheck& check) {
  fmt::print("{:<12} {:>9} {:>9} {:>9}\n", "camera", "dx px", "dy px", "off px");
  for (const FlameDrift& camera : check.cameras)
    fmt::print("{:<12} {:>9.3f} {:>9.3f} {:>9.3f}{}\n", camera.camera, camera.shift_px.x(),
               camera.shift_px.y(), camera.shift_px.norm(), camera.moved ? "  moved" : "");
  fmt::print("{} of {} cameras have moved; the flame fits the others to {:.3f} px at the median\n",
             check.moved.size(), check.cameras.size(), check.typical_px);
}

void print(const RigComparison& comparison, const std::string& with) {
  for (const CameraShift& camera : comparison.cameras) {
    if (camera.moved)
      fmt::print("{} has moved: {:.2f} px in the measuring volume since {}\n", camera.camera, camera.shift_px,
                 with);
  }
  double most = 0;
  for (const CameraShift& camera : comparison.cameras)
    if (!camera.moved) most = std::max(most, camera.shift_px);
  fmt::print("{} of {} cameras have moved since {}; the others agree to {:.3f} px\n", comparison.moved.size(),
             comparison.cameras.size(), with, most);
}

}  // namespace flamefield
