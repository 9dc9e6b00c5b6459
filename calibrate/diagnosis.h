#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "calibrate/corner_region.h"
#include "proto/board.h"

namespace flamefield {

// Too dark or overexposed; none when there is light and contrast enough.
std::optional<std::string> exposure_fault(const cv::Mat& grey);

// Why no board was found in a picture, in the order in which it can be cured: too dark, overexposed, another
// board, blurred, cut off, too oblique, or nothing like a board. Only for pictures that failed: it looks
// again, more closely. `grey` has the camera's levels, `bytes` the same over their span. (rows, cols)
std::string why_not_found(const cv::Mat& grey, const cv::Mat& bytes, const CornerRegion& region,
                          const BoardSpec& board);

}  // namespace flamefield
