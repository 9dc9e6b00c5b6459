#pragma once

#include <filesystem>
#include <vector>

#include "calibrate/detect.h"
#include "proto/rig.h"

namespace flamefield {

// Pictures of a board: folders of one camera each, a folder of such folders, single files of such folders, or
// recorded sessions (.nxs). Where a rig is given, files named as its cameras (cam00.png) all show the same
// pose. Ends the command when there are none or one cannot be read.
std::vector<BoardView> read_board_views(const std::vector<std::filesystem::path>& paths,
                                        const Rig* rig = nullptr);

}  // namespace flamefield
