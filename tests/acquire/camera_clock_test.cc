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

TEST(CameraClock, EqualsTheLeastSquaresLineThroughItsPulses) {
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
  for (std::int64_t pulse = 1; pulse <= 10; ++pulse)
    clock.learn(pulse * kPeriod_ns, pulse * kPeriod_ns + 7'000'000);
  EXPECT_TRUE(clock.is_settled(1'000'000));
  clock.reset();
  EXPECT_FALSE(clock.is_settled(1'000'000));
  EXPECT_EQ(clock.common_of(123), 123);
}

TEST(CameraClock, DoesNotContradictAnybodyWhileItIsTaughtWrongly) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> jump_ns(-2e6, 2e6);
  CameraClock clock;
  for (std::int64_t pulse = 1; pulse <= 30; ++pulse) {
    clock.learn(pulse * kPeriod_ns, pulse * kPeriod_ns + std::llround(jump_ns(random)));
    EXPECT_FALSE(clock.is_settled(2'500'000)) << pulse;
  }
  for (std::int64_t pulse = 31; pulse <= 400; ++pulse) clock.learn(pulse * kPeriod_ns, pulse * kPeriod_ns);
  EXPECT_TRUE(clock.is_settled(2'500'000));
}

// 300 pulses in three bursts with pauses of a minute: found by brute force that gains of a filter with fixed
// steps drive its drift away here.
TEST(CameraClock, BurstsAndPausesDoNotDriveItAway) {
  std::mt19937 random(3);
  std::normal_distribution<double> jitter_ns(0, 1e4);
  CameraClock clock;
  std::int64_t now_ns = 0;
  for (int pulse = 0; pulse < 300; ++pulse) {
    now_ns += pulse % 100 == 99 ? 60'000'000'000 : 10'000'000;
    const auto camera_ns =
        static_cast<std::int64_t>(static_cast<double>(now_ns) * (1 + 60e-6) + jitter_ns(random));
    if (pulse > 10) {
      const double allowed_ns = pulse % 100 == 99 ? 4e6 : 2e5;
      EXPECT_NEAR(static_cast<double>(clock.common_of(camera_ns) - now_ns), 0, allowed_ns) << pulse;
    }
    clock.learn(camera_ns, now_ns);
  }
}

}  // namespace
}  // namespace flamefield
