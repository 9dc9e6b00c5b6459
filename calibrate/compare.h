#pragma once

#include <string>
#include <vector>

#include "calibrate/check.h"
#include "calibrate/quality.h"
#include "proto/rig.h"

namespace flamefield {

struct CameraShift {
  std::string camera;
  double shift_px = 0;  // RMS over the measuring volume, the world of the cameras that stand still being one
  bool moved = false;
};

// What became of a ring since an earlier calibration.
struct RigComparison {
  std::vector<CameraShift> cameras;  // that both hold, in the newer rig's order
  std::vector<std::string> moved;
  std::vector<std::string> added, missing;
  double world_shift_mm = 0;  // of the measuring volume's centre: the board on the burner stood elsewhere
  double world_turn_rad = 0;
};

// The world frames are laid upon each other by the cameras that agree; those that do not have moved. Limits
// as in check(). InvalidInput: fewer than three cameras in common.
Result<RigComparison> compare_rigs(const Rig& now, const Rig& before, const MeasuringVolume& volume,
                                   const CheckOptions& options = {});

}  // namespace flamefield
