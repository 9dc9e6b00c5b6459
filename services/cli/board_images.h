#pragma once

#include <filesystem>
#include <vector>

#include "calibrate/detect.h"

namespace flamefield {

// Pictures of a board: folders of one camera each, a folder of such folders, or recorded sessions (.nxs).
// Ends the command when there are none or one cannot be read.
std::vector<BoardView> read_board_views(const std::vector<std::filesystem::path>& paths);

}  // namespace flamefield
