#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "proto/board.h"

namespace flamefield {

// The picture with the light on the board evened out around its corners: 0 is the dark squares' level, 1 that
// of the white ones, each a plane over the picture. Where the light falls off, the edges of a corner pull it
// towards the light, in all pictures alike: 0.007 px for 20 % from the middle of the plate to its edge, which
// no residual shows. `corners_px` row by row, (rows, cols). (grey: CV_32F; so is the result, of the same
// size)
cv::Mat without_shading(const cv::Mat& grey, const std::vector<cv::Point2f>& corners_px,
                        const BoardSpec& board);

}  // namespace flamefield
