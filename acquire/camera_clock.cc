#include "acquire/camera_clock.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

constexpr std::int64_t kMemory = 30;        // pulses
constexpr double kMostDrift = 200e-6;       // between two quartzes
constexpr double kShortest_ns = 1'000'000;  // between two pulses that say anything about drift

}  // namespace

std::int64_t CameraClock::common_of(std::int64_t camera_ns) const {
  const auto since_ns = static_cast<double>(camera_ns - last_ns_);
  return camera_ns + std::llround(offset_ns_ + (matches_ > 0 ? drift_ * since_ns : 0));
}

void CameraClock::learn(std::int64_t camera_ns, std::int64_t common_ns) {
  const auto since_ns = static_cast<double>(camera_ns - last_ns_);
  if (matches_ > 0 && since_ns < kShortest_ns) return;
  const auto n = static_cast<double>(std::min(matches_, kMemory));
  const double alpha = 2 * (2 * n + 1) / ((n + 1) * (n + 2)), beta = 6 / ((n + 1) * (n + 2));
  const auto residual_ns = static_cast<double>(common_ns - common_of(camera_ns));
  if (matches_ > 0) {
    offset_ns_ += drift_ * since_ns + alpha * residual_ns;
    drift_ = std::clamp(drift_ + beta * residual_ns / since_ns, -kMostDrift, kMostDrift);
  } else {
    offset_ns_ = residual_ns;
  }
  if (is_settled()) mean_square_ns2_ += (residual_ns * residual_ns - mean_square_ns2_) / n;
  last_ns_ = camera_ns;
  ++matches_;
}

}  // namespace flamefield
