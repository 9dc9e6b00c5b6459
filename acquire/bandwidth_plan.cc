#include "acquire/bandwidth_plan.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "proto/check.h"

namespace flamefield {

namespace {

// Preamble 8, header 14, check sum 4, gap 12: IEEE 802.3.
constexpr std::int64_t kEthernet_bytes = 38;
constexpr std::int64_t kLeastPacket_bytes = 46;      // of IP on the wire; shorter ones are padded
constexpr std::int64_t kHeaders_bytes = 20 + 8 + 8;  // IP, UDP, GVSP
constexpr std::int64_t kLeader_bytes = kHeaders_bytes + 36, kTrailer_bytes = kHeaders_bytes + 8;
constexpr std::int64_t kChunks_bytes = 8 + 12 + 12 + 16 + 12;
constexpr double kReserve = 1.05;  // for control traffic and packets that are sent again
constexpr double kHighLoad = 0.8;

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f", value);
  return text;
}

std::int64_t on_wire(std::int64_t ip_bytes) {
  return std::max(ip_bytes, kLeastPacket_bytes) + kEthernet_bytes;
}

}  // namespace

std::int64_t wire_bytes_of_frame(const BandwidthNeeds& needs) {
  const std::int64_t image =
      static_cast<std::int64_t>(bytes_of_image(needs.format, needs.width_px, needs.height_px));
  const std::int64_t payload = needs.payload_bytes > 0 ? needs.payload_bytes : image + kChunks_bytes;
  const std::int64_t room = needs.packet_size_bytes - kHeaders_bytes;
  expect(room > 0, "a packet has room for pixels");
  const std::int64_t rest = payload % room;
  return payload / room * on_wire(needs.packet_size_bytes) + (rest > 0 ? on_wire(rest + kHeaders_bytes) : 0) +
         on_wire(kLeader_bytes) + on_wire(kTrailer_bytes);
}

Result<BandwidthPlan> plan_bandwidth(const BandwidthNeeds& needs) {
  expect(needs.cameras > 0 && needs.rate_hz > 0 && needs.uplink_bits_per_s > 0 &&
             needs.camera_link_bits_per_s > 0,
         "there are cameras, pulses and links");
  BandwidthPlan plan;
  const auto cameras = static_cast<double>(needs.cameras);
  plan.frame_wire_bytes = wire_bytes_of_frame(needs);
  plan.frame_ms = 8e3 * static_cast<double>(plan.frame_wire_bytes) / needs.uplink_bits_per_s;
  plan.burst_ms = cameras * plan.frame_ms * kReserve;
  plan.period_ms = 1e3 / needs.rate_hz;
  plan.load = plan.burst_ms / plan.period_ms;
  plan.most_rate_hz = 1e3 / plan.burst_ms;
  // What n cameras send at once and the uplink cannot take at that time, the switch must hold.
  const double ratio = needs.camera_link_bits_per_s / needs.uplink_bits_per_s;
  const auto held_bytes = [&](std::size_t n) {
    return static_cast<double>(plan.frame_wire_bytes) * std::max(static_cast<double>(n) - 1 / ratio, 0.0);
  };
  plan.at_once = 1;
  while (plan.at_once < needs.cameras &&
         held_bytes(plan.at_once + 1) <= static_cast<double>(needs.switch_buffer_bytes))
    ++plan.at_once;
  for (std::size_t i = 0; i < needs.cameras; ++i) {
    const auto before = static_cast<double>(i / plan.at_once * plan.at_once);
    plan.frame_delay_ns.push_back(std::llround(before * plan.frame_ms * kReserve * 1e6));
  }
  const std::string numbers = concat(
      needs.cameras, " frames of ", name_of(needs.format), ", ", needs.width_px, "x", needs.height_px,
      " px, take ", number(plan.burst_ms), " ms of the ", number(plan.period_ms), " ms between pulses");
  if (plan.load > 1 || 1e-3 * needs.exposure_us > plan.period_ms) {
    return invalid_input(numbers, "the pictures of one pulse would not be through before the next",
                         concat("trigger at ", number(plan.most_rate_hz),
                                " Hz or less, choose fewer bits or a smaller region, or a faster uplink"));
  }
  if (plan.load > kHighLoad) {
    plan.warnings.push_back(concat(numbers, " (little is left for packets that are lost) trigger at ",
                                   number(kHighLoad * plan.most_rate_hz), " Hz or less"));
  }
  if (needs.packet_size_bytes < 8000 && plan.load > 0.5) {
    plan.warnings.push_back(
        concat("packets of ", needs.packet_size_bytes,
               " bytes (much of the link goes into headers) use 9000 where every switch can"));
  }
  return plan;
}

}  // namespace flamefield
