#include "calibrate/corner_region.h"

#include <numbers>
#include <opencv2/imgproc.hpp>

namespace flamefield {

CornerRegion corner_region(const cv::Mat& bytes) {
  constexpr double kSigma = 1.5;
  cv::Mat smooth, xx, yy, xy;
  bytes.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, {}, kSigma);
  cv::Sobel(smooth, xx, CV_32F, 2, 0, 3, 0.25);
  cv::Sobel(smooth, yy, CV_32F, 0, 2, 3, 0.25);
  cv::Sobel(smooth, xy, CV_32F, 1, 1, 3, 0.25);
  const cv::Mat saddle = xy.mul(xy) - xx.mul(yy);
  cv::Mat highest;
  cv::dilate(saddle, highest, cv::Mat::ones(5, 5, CV_8U));

  // A sharp corner of full contrast C, smoothed by sigma, has Ixy = C / (pi sigma^2). A third of the
  // contrast, or blur of twice sigma, still passes.
  constexpr double kSharp = 255 / (std::numbers::pi * kSigma * kSigma);
  constexpr auto kLimit = static_cast<float>(0.03 * kSharp * kSharp);
  CornerRegion region;
  for (int y = 0; y < saddle.rows; ++y) {
    const auto* value = saddle.ptr<float>(y);
    const auto* peak = highest.ptr<float>(y);
    for (int x = 0; x < saddle.cols; ++x) {
      if (value[x] < kLimit || value[x] < peak[x]) continue;
      region.box = region.points.empty() ? cv::Rect(x, y, 1, 1) : region.box | cv::Rect(x, y, 1, 1);
      region.points.emplace_back(x, y);
    }
  }
  return region;
}

}  // namespace flamefield
