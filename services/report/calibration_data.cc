#include "services/report/calibration_data.h"

#include <algorithm>

namespace flamefield {

ReportCalibration report_calibration(const CalibrationReport& found) {
  ReportCalibration out;
  out.session = std::make_shared<const CalibrationReport>(found);
  out.rig = found.rig;
  out.expected_error_mean_px = found.expected_volume_error.mean_px;
  out.expected_error_worst_px = found.expected_volume_error.worst_px;
  out.expected_error_worst_camera = found.expected_volume_error.worst_camera;
  out.rms_px.assign(found.rig.cameras.size(), std::vector<double>(found.poses.size(), kUnknown));
  for (const ViewReport& view : found.views) {
    if (!view.is_used()) continue;
    const auto camera = found.rig.find(view.camera);
    const auto pose = std::ranges::find(found.poses, view.pose) - found.poses.begin();
    if (camera) out.rms_px[*camera][static_cast<std::size_t>(pose)] = view.rms_px;
    for (std::size_t i = 0; i < view.residuals_px.size(); ++i) {
      if (!view.used[i]) continue;
      out.residuals_px.push_back(static_cast<float>(view.residuals_px[i].x()));
      out.residuals_px.push_back(static_cast<float>(view.residuals_px[i].y()));
    }
  }
  return out;
}

}  // namespace flamefield
