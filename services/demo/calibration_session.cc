#include "services/demo/calibration_session.h"

#include <cstdio>

#include "calibrate/detect.h"

namespace flamefield {

Result<CalibrationReport> calibrate_session(const std::vector<FrameSet>& sets, const BoardSpec& board,
                                            const Rigid3& world_from_reference_board,
                                            const std::vector<std::string>& cameras,
                                            const std::function<void(std::int64_t, std::int64_t)>& progress,
                                            std::stop_token stop) {
  std::vector<BoardView> views;
  for (const FrameSet& set : sets) {
    char pose[16];
    std::snprintf(pose, sizeof pose, "pose%03d", static_cast<int>(set.index));
    for (const Frame& frame : set.frames) {
      auto image = grey_levels(frame);
      if (!image) return tl::unexpected(image.error());
      views.push_back({frame.camera, pose, std::move(*image)});
    }
  }
  // In portions, so that a stop need not wait for all of them.
  std::vector<Detection> detections;
  constexpr std::size_t kPortion = 30;
  for (std::size_t first = 0; first < views.size(); first += kPortion) {
    if (stop.stop_requested()) return unavailable("calibration", "stopped", "run it again");
    const std::span portion(views.data() + first, std::min(kPortion, views.size() - first));
    auto found = detect(portion, board);
    if (!found) return tl::unexpected(found.error());
    detections.insert(detections.end(), found->begin(), found->end());
    progress(static_cast<std::int64_t>(detections.size()), static_cast<std::int64_t>(views.size()));
  }
  CalibrationOptions options;
  options.cameras = cameras;
  options.reference_pose = "pose000";
  options.world_from_reference = world_from_reference_board;
  options.volume.centre_mm = world_from_reference_board.translation_mm;
  return calibrate(detections, board, options);
}

}  // namespace flamefield
