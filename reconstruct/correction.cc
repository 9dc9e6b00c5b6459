#include "reconstruct/correction.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "proto/check.h"

namespace flamefield {

namespace {

std::vector<float> cut(const Image& image, const Window& window) {
  expect(window.x0 + window.width <= image.width_px && window.y0 + window.height <= image.height_px,
         "the window is on the sensor");
  std::vector<float> out;
  out.reserve(window.pixels());
  for (int y = 0; y < window.height; ++y) {
    const auto row =
        image.pixels.begin() + static_cast<std::ptrdiff_t>(window.y0 + y) * image.width_px + window.x0;
    out.insert(out.end(), row, row + window.width);
  }
  return out;
}

// Pixels whose dark level stands out from the median of their neighbourhood, against the robust spread
// (1.4826 median absolute deviations, at least a quarter grey level) of all.
cv::Mat marked_hot(const std::vector<float>& dark, const Window& window, double sigmas) {
  const cv::Mat image(window.height, window.width, CV_32F, const_cast<float*>(dark.data()));
  cv::Mat median;
  cv::medianBlur(image, median, 5);
  const cv::Mat difference = cv::abs(image - median);
  std::vector<float> deviations(difference.begin<float>(), difference.end<float>());
  const auto middle = deviations.begin() + static_cast<std::ptrdiff_t>(deviations.size() / 2);
  std::nth_element(deviations.begin(), middle, deviations.end());
  const double spread = std::max(1.4826 * static_cast<double>(*middle), 0.25);
  return difference > sigmas * spread;
}

}  // namespace

SensorCorrection::SensorCorrection(const Window& window, const Image* dark, const Image* background,
                                   const Image* flat, double hot_sigma)
    : window_(window) {
  if (dark) find_hot_pixels(*dark, hot_sigma);
  if (const Image* offset = background ? background : dark) offset_ = cut(*offset, window);
  if (!flat) return;
  gain_ = cut(*flat, window);
  if (dark) {
    const std::vector<float> level = cut(*dark, window);
    for (std::size_t i = 0; i < gain_.size(); ++i) gain_[i] -= level[i];
  }
  const double mean = std::accumulate(gain_.begin(), gain_.end(), 0.0) / static_cast<double>(gain_.size());
  for (float& g : gain_) {
    const double response = mean > 0 ? g / mean : 1;
    g = response > 0.05 ? static_cast<float>(1 / response) : 0;
  }
}

void SensorCorrection::find_hot_pixels(const Image& dark, double hot_sigma) {
  const cv::Mat marked = marked_hot(cut(dark, window_), window_, hot_sigma);
  for (int y = 0; y < window_.height; ++y)
    for (int x = 0; x < window_.width; ++x) {
      if (!marked.at<std::uint8_t>(y, x)) continue;
      HotPixel hot{static_cast<std::uint32_t>(y * window_.width + x), {}};
      for (int j = std::max(y - 1, 0); j <= std::min(y + 1, window_.height - 1); ++j)
        for (int i = std::max(x - 1, 0); i <= std::min(x + 1, window_.width - 1); ++i)
          if (!marked.at<std::uint8_t>(j, i))
            hot.neighbours.push_back(static_cast<std::uint32_t>(j * window_.width + i));
      hot_.push_back(std::move(hot));
    }
}

std::size_t SensorCorrection::count_used(std::span<const std::uint32_t> pixels, int sensor_width_px) const {
  return static_cast<std::size_t>(std::ranges::count_if(pixels, [&](std::uint32_t i) {
    const int x = static_cast<int>(i) % sensor_width_px - window_.x0,
              y = static_cast<int>(i) / sensor_width_px - window_.y0;
    if (x < 0 || y < 0 || x >= window_.width || y >= window_.height) return false;
    return !std::ranges::binary_search(hot_, static_cast<std::uint32_t>(y * window_.width + x), {},
                                       &HotPixel::index);
  }));
}

std::vector<float> SensorCorrection::apply(const Image& raw) const {
  std::vector<float> out = cut(raw, window_);
  if (!offset_.empty())
    for (std::size_t i = 0; i < out.size(); ++i) out[i] -= offset_[i];
  if (!gain_.empty())
    for (std::size_t i = 0; i < out.size(); ++i) out[i] *= gain_[i];
  for (const HotPixel& hot : hot_) {
    std::array<float, 8> near{};
    const auto count = static_cast<std::ptrdiff_t>(hot.neighbours.size());
    for (std::size_t i = 0; i < hot.neighbours.size(); ++i) near[i] = out[hot.neighbours[i]];
    if (count == 0) continue;
    std::nth_element(near.begin(), near.begin() + count / 2, near.begin() + count);
    out[hot.index] = near[static_cast<std::size_t>(count / 2)];
  }
  return out;
}

}  // namespace flamefield
