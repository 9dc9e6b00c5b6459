#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "proto/board.h"
#include "proto/error.h"

namespace flamefield {

struct CharucoCorners {
  std::vector<Eigen::Vector2d> corners_px;  // as in Detection
  int markers = 0;                          // of the board that were recognised
  std::string reason;                       // why there are no corners
};

// The corners of whatever part of the board is seen. The markers that lie on one plane with most of the
// others say where each corner is expected, by the markers next to it (the lens bends the plane);
// cornerSubPix refines in a window that reaches none of the markers' corners. `grey` has the camera's levels,
// `bytes` the same over their span. (rows, cols)
CharucoCorners find_charuco(const cv::Mat& grey, const cv::Mat& bytes, const BoardSpec& board);

// InvalidInput: no such dictionary, or it has fewer markers than the board needs.
Result<> check_dictionary(const BoardSpec& board);

// What is printed into the board's white squares. (markers)
std::vector<MarkerPattern> marker_patterns(const BoardSpec& board);

}  // namespace flamefield
