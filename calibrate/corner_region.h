#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace flamefield {

// Where checkerboard corners may be: saddle points of the smoothed grey levels, i.e. strong local maxima of
// Ixy^2 - Ixx Iyy. An order of magnitude cheaper than looking for the board itself.
struct CornerRegion {
  std::vector<cv::Point> points;
  cv::Rect box;  // around all points, unexpanded

  int candidates() const { return static_cast<int>(points.size()); }
};
CornerRegion corner_region(const cv::Mat& bytes);  // (rows, cols), 8 bits over the image's span

}  // namespace flamefield
