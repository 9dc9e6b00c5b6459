#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/calibrate.h"
#include "proto/board.h"
#include "proto/frame.h"

namespace flamefield {

// From the frame sets of a board capture to a rig: set k shows the board's pose k, the first one in its
// holder on the burner. Poses are named pose000, pose001, ... Each of `cameras` has to be tied to the others.
// Unavailable when stopped.
Result<CalibrationReport> calibrate_session(
    const std::vector<FrameSet>& sets, const BoardSpec& board, const Rigid3& world_from_reference_board,
    const std::vector<std::string>& cameras,
    const std::function<void(std::int64_t done, std::int64_t total)>& progress, std::stop_token stop);

}  // namespace flamefield
