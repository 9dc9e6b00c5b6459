#pragma once

#include <opencv2/core.hpp>

namespace flamefield {

// Where checkerboard corners may be: saddle points of the smoothed grey levels, i.e. strong local maxima of
// Ixy^2 - Ixx Iyy. An order of magnitude cheaper than looking for the board itself.
struct CornerRegion {
  int candidates = 0;
  cv::Rect box;  // around all candidates, unexpanded
};
CornerRegion corner_region(const cv::Mat& bytes);  // (rows, cols), 8 bits over the image's span

}  // namespace flamefield
