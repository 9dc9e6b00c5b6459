#pragma once

#include <Eigen/Core>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"
#include "proto/recipe.h"
#include "proto/rig.h"
#include "proto/volume.h"

namespace flamefield {

struct FlameCheckOptions {
  double moved_px = 0.5;    // a camera whose pictures lie further off than this ...
  double moved_factor = 3;  // ... and than this many times the median of all has moved
  int iterations = 20;      // of MLEM, for each camera and set
  int threads = 0;          // 0: all
  std::stop_token stop = {};
};

struct FlameDrift {
  std::string camera;
  Eigen::Vector2d shift_px{0, 0};  // the picture as taken, against the one that the other cameras foretell
  bool moved = false;
};

struct FlameCheck {
  std::vector<FlameDrift> cameras;  // in the projections' order
  std::vector<std::string> moved;   // the worst one first
  double typical_px = 0;            // median shift of the cameras that stand still
};

// Has a camera moved, by what the flame itself says? The field is reconstructed from the pictures of all
// other cameras and projected into each camera in turn; its picture is then shifted against that until both
// fit best (Gauss-Newton, one shift and one brightness for all sets). The camera that is off most is left out
// of what the others are judged by, until no more is found. It sees shifts across the line of sight only, and
// by as much less as the views are few. InvalidInput: fewer than five views, sets of different views, dark
// sets.
Result<FlameCheck> check_by_flame(const Rig& rig, const Grid& grid, std::span<const Projections> sets,
                                  const FlameCheckOptions& options = {});

}  // namespace flamefield
