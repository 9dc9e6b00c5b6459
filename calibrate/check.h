#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrate/detect.h"
#include "proto/rig.h"

namespace flamefield {

struct CheckOptions {
  double moved_px = 0.5;    // a camera whose RMS exceeds this ...
  double moved_factor = 3;  // ... and this many times the median of all has moved
};

struct CameraCheck {
  std::string camera;
  int images = 0;  // in which it saw the board
  int corners = 0;
  double rms_px = 0;              // against the board pose that the unmoved cameras agree on
  Eigen::Vector2d mean_px{0, 0};  // mean of expected minus seen: which way it points off
  bool moved = false;
};

struct CheckReport {
  std::vector<CameraCheck> cameras;  // in the rig's order
  std::vector<std::string> moved;
  std::vector<std::string> unseen;  // cameras of the rig that saw no board: nothing is known about them
  double rms_px = 0;                // of the cameras that have not moved
};

// Has a camera moved since the rig was calibrated? One board pose is enough when at least three cameras see
// it. InvalidInput: a camera that the rig lacks, another image size, fewer than three cameras with a board.
Result<CheckReport> check(const Rig& rig, std::span<const Detection> detections, const BoardSpec& board,
                          const CheckOptions& options = {});

}  // namespace flamefield
