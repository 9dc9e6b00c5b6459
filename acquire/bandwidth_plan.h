#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/frame.h"

namespace flamefield {

// All cameras answer one pulse at the same time, through a switch with one uplink to this machine.
struct BandwidthNeeds {
  std::size_t cameras = 15;
  double rate_hz = 5;  // of the trigger
  int width_px = 659;
  int height_px = 494;
  PixelFormat format = PixelFormat::Mono8;
  std::int64_t payload_bytes = 0;  // of a frame with its chunks, as a camera says; 0: of size and format
  int packet_size_bytes = 1500;    // IP and UDP headers included
  int exposure_us = 350;
  double uplink_bits_per_s = 1e9;
  double camera_link_bits_per_s = 1e9;
  std::int64_t switch_buffer_bytes = 128 << 10;  // what the switch can hold back for the uplink
};

struct BandwidthPlan {
  std::int64_t frame_wire_bytes = 0;         // Ethernet preamble, headers and gaps included
  double frame_ms = 0;                       // one frame on the uplink
  double burst_ms = 0;                       // all frames of one pulse on the uplink
  double period_ms = 0;                      // between pulses
  double load = 0;                           // of the uplink, 1 is full
  double most_rate_hz = 0;                   // that would fit
  std::size_t at_once = 0;                   // cameras that may send together
  std::vector<std::int64_t> frame_delay_ns;  // of each camera, before it sends
  std::vector<std::string> warnings;
};

// InvalidInput, with the numbers: the pictures of one pulse are not through before the next one.
Result<BandwidthPlan> plan_bandwidth(const BandwidthNeeds& needs);

// Bytes on the wire of one frame.
std::int64_t wire_bytes_of_frame(const BandwidthNeeds& needs);

}  // namespace flamefield
