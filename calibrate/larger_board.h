#pragma once

#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "proto/board.h"

namespace flamefield {

// Whether the corners are the crossings of a board's squares: light and dark ones in turn between them.
// A detector that looks for few corners may pick some of a larger board's, slanting across it. Arguments as
// below.
bool is_grid(const cv::Mat& bytes, const std::vector<cv::Point2f>& corners, const BoardSpec& board);

// The board in the picture where its squares go on alternating beyond the corners that were found: those are
// a part of it then, and nobody can tell which one. None when a rim or the edge of the image follows.
// `corners` row by row, whichever end first; `bytes` over the image's span.
std::optional<cv::Size> larger_board(const cv::Mat& bytes, const std::vector<cv::Point2f>& corners,
                                     const BoardSpec& board);

}  // namespace flamefield
