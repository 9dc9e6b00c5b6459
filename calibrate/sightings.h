#pragma once

#include <cstddef>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "calibrate/calibrate.h"

namespace flamefield {

// The detections of a session with cameras and poses numbered in the order of their first appearance.
struct Sightings {
  std::vector<std::string> cameras;
  std::vector<std::string> poses;
  struct View {
    std::size_t camera = 0;
    std::size_t pose = 0;
    const Detection* detection = nullptr;
  };
  std::vector<View> views;  // (detections)
  std::size_t reference = 0;
  std::deque<Detection> replaced;  // that views point to instead of what was given

  // Views of one camera in which the board was found.
  std::vector<const Detection*> found_by(std::size_t camera) const;
};

// Checks that a calibration can start. The detections must outlive the result. Errors as of calibrate().
Result<Sightings> sight(std::span<const Detection> detections, const BoardSpec& board,
                        const CalibrationOptions& options);

}  // namespace flamefield
