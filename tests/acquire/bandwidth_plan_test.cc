#include "acquire/bandwidth_plan.h"

#include <gmock/gmock.h>

#include <algorithm>

namespace flamefield {
namespace {

using ::testing::HasSubstr;

TEST(BandwidthPlan, TwentyFourCamerasOfEightBitsTakeSixtySixMillisecondsOfAGigabitLink) {
  const auto plan = plan_bandwidth({.cameras = 24});
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_NEAR(24 * plan->frame_ms, 66, 1);
  EXPECT_TRUE(plan->warnings.empty());
}

TEST(BandwidthPlan, FrameOnTheWireIsTheSumOfItsPacketsCountedOneByOne) {
  for (int packet_size : {576, 1500, 9000}) {
    for (PixelFormat format : {PixelFormat::Mono8, PixelFormat::Mono12Packed, PixelFormat::Mono12}) {
      const BandwidthNeeds needs{.format = format, .packet_size_bytes = packet_size};
      std::int64_t left = static_cast<std::int64_t>(bytes_of_image(format, 659, 494)) + 60;
      std::int64_t wire = (20 + 8 + 8 + 36 + 38) + (46 + 38);  // leader, padded trailer
      while (left > 0) {
        const std::int64_t part = std::min<std::int64_t>(left, packet_size - 36);
        wire += std::max<std::int64_t>(part + 36, 46) + 38;
        left -= part;
      }
      EXPECT_EQ(wire_bytes_of_frame(needs), wire) << packet_size << " " << name_of(format);
    }
  }
}

TEST(BandwidthPlan, RateThatDoesNotFitIsRefusedWithTheNumbersAndTheRateThatWould) {
  const auto plan = plan_bandwidth({.cameras = 24, .rate_hz = 20, .format = PixelFormat::Mono12});
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::InvalidInput);
  EXPECT_THAT(plan.error().message, HasSubstr("24 frames of Mono12"));
  EXPECT_THAT(plan.error().message, HasSubstr("50.0 ms between pulses"));
  const auto fits = plan_bandwidth({.cameras = 24, .rate_hz = 7, .format = PixelFormat::Mono12});
  EXPECT_TRUE(fits) << fits.error().message;
}

// The oracle: a queue fed by all cameras at line rate, each from its delay on, drained at the uplink's rate.
TEST(BandwidthPlan, DelaysKeepTheSwitchWithinItsBuffer) {
  for (std::int64_t buffer : {64 << 10, 512 << 10, 2 << 20, 64 << 20}) {
    for (double camera_link : {1e8, 1e9}) {
      const BandwidthNeeds needs{.camera_link_bits_per_s = camera_link, .switch_buffer_bytes = buffer};
      const auto plan = plan_bandwidth(needs);
      ASSERT_TRUE(plan);
      ASSERT_EQ(plan->frame_delay_ns.size(), needs.cameras);
      constexpr double kStep_s = 5e-6;
      std::vector<double> left(needs.cameras, static_cast<double>(plan->frame_wire_bytes));
      double held = 0, most = 0;
      for (double now_s = 0; now_s < 0.2; now_s += kStep_s) {
        for (std::size_t i = 0; i < needs.cameras; ++i) {
          if (now_s < 1e-9 * static_cast<double>(plan->frame_delay_ns[i])) continue;
          const double sent = std::min(left[i], camera_link / 8 * kStep_s);
          left[i] -= sent, held += sent;
        }
        held = std::max(0.0, held - needs.uplink_bits_per_s / 8 * kStep_s);
        most = std::max(most, held);
      }
      EXPECT_EQ(*std::max_element(left.begin(), left.end()), 0) << "not all was sent in a period";
      EXPECT_LE(most,
                std::max(static_cast<double>(buffer), static_cast<double>(plan->frame_wire_bytes)) * 1.01)
          << buffer << " " << camera_link;
    }
  }
}

}  // namespace
}  // namespace flamefield
