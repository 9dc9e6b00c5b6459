#include "acquire/camera_clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace flamefield {
namespace {

constexpr std::int64_t kPeriod_ns = 200'000'000;

// The camera's time of pulse p: its clock is `offset` behind and fast by `drift`.
std::int64_t camera_time(std::int64_t pulse, double offset_ns, double drift) {
  return std::llround(static_cast<double>(pulse * kPeriod_ns) * (1 + drift) - offset_ns);
}

TEST(CameraClock, KnowsOffsetAndDriftOfAQuartzAfterAFewPulses) {
  CameraClock clock;
  for (std::int64_t pulse = 1; pulse <= 30; ++pulse) {
    clock.learn(camera_time(pulse, 3e6, 50e-6), pulse * kPeriod_ns);
  }
  EXPECT_NEAR(clock.drift_ppm(), -50, 0.5);
  const std::int64_t later = 330;  // a minute without pulses
  EXPECT_NEAR(static_cast<double>(clock.common_of(camera_time(later, 3e6, 50e-6)) - later * kPeriod_ns), 0,
              50e3);
}

TEST(CameraClock, EqualsTheLeastSquaresLineWhileItsMemoryGrows) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE(seed);
  std::mt19937 random(seed);
  std::normal_distribution<double> jitter_ns(0, 2e4);
  CameraClock clock;
  double n = 0, sx = 0, sy = 0, sxx = 0, sxy = 0;
  std::int64_t camera_ns = 0;
  for (std::int64_t pulse = 1; pulse <= 25; ++pulse) {
    camera_ns = pulse * kPeriod_ns;
    const double offset_ns = 1e6 + 40e-6 * static_cast<double>(camera_ns) + jitter_ns(random);
    clock.learn(camera_ns, camera_ns + std::llround(offset_ns));
    const double x = static_cast<double>(pulse), y = std::round(offset_ns);
    n += 1, sx += x, sy += y, sxx += x * x, sxy += x * y;
  }
  const double slope = (n * sxy - sx * sy) / (n * sxx - sx * sx), mean = (sy - slope * sx) / n;
  const double fitted_ns = mean + slope * 25;
  EXPECT_NEAR(static_cast<double>(clock.common_of(camera_ns) - camera_ns), fitted_ns, 2e3);
  EXPECT_NEAR(clock.drift_ppm(), 1e6 * slope / static_cast<double>(kPeriod_ns), 0.1);
}

TEST(CameraClock, ForgetsAllWhenItsCameraStartsAgain) {
  CameraClock clock;
  for (std::int64_t pulse = 1; pulse <= 5; ++pulse)
    clock.learn(pulse * kPeriod_ns, pulse * kPeriod_ns + 7'000'000);
  EXPECT_TRUE(clock.is_settled());
  clock.reset();
  EXPECT_FALSE(clock.is_settled());
  EXPECT_EQ(clock.common_of(123), 123);
}

}  // namespace
}  // namespace flamefield
