#include "acquire/camera_clock.h"

#include <algorithm>

namespace flamefield {

namespace {

constexpr std::size_t kMemory = 32;  // pulses
// (noise / drift)^2 expected of cameras: 20 us of the one, 100 ppm of the other.
constexpr double kRidge_ns2 = (20e3 / 100e-6) * (20e3 / 100e-6);
constexpr double kSpreadMemory = 16;  // pulses

}  // namespace

std::int64_t CameraClock::common_of(std::int64_t camera_ns) const {
  return camera_ns + std::llround(offset_ns_ + drift_ * static_cast<double>(camera_ns - centre_ns_));
}

void CameraClock::learn(std::int64_t camera_ns, std::int64_t common_ns) {
  if (!points_.empty() && camera_ns <= points_.back().camera_ns) return;
  if (points_.size() >= 2) {
    const auto residual_ns = static_cast<double>(common_ns - common_of(camera_ns));
    const double n = std::min(kSpreadMemory, static_cast<double>(points_.size() - 1));
    mean_square_ns2_ += (residual_ns * residual_ns - mean_square_ns2_) / n;
  }
  points_.push_back({camera_ns, common_ns - camera_ns});
  if (points_.size() > kMemory) points_.pop_front();
  fit();
}

void CameraClock::fit() {
  const Point& first = points_.front();
  const auto n = static_cast<double>(points_.size());
  double mean_x = 0, mean_y = 0;
  for (const Point& point : points_) {
    mean_x += static_cast<double>(point.camera_ns - first.camera_ns) / n;
    mean_y += static_cast<double>(point.offset_ns - first.offset_ns) / n;
  }
  double sxx = 0, sxy = 0;
  for (const Point& point : points_) {
    const double x = static_cast<double>(point.camera_ns - first.camera_ns) - mean_x;
    sxx += x * x;
    sxy += x * (static_cast<double>(point.offset_ns - first.offset_ns) - mean_y);
  }
  drift_ = sxy / (sxx + kRidge_ns2);
  centre_ns_ = first.camera_ns + std::llround(mean_x);
  offset_ns_ = static_cast<double>(first.offset_ns) + mean_y;
}

}  // namespace flamefield
