#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "proto/error.h"
#include "proto/frame.h"

namespace flamefield {

// One camera of an array.
struct CameraAddress {
  std::string name;          // as in the rig: cam00, cam01, ...
  std::string address = {};  // IPv4; empty: found by serial, else by user-defined name, with a broadcast
  std::string serial = {};   // refused when another camera is there; empty: whichever was there first
  std::int64_t frame_delay_ns = 0;  // before it sends a frame: its place in the bandwidth plan
};

// Pixels that a camera sends, and the bytes of one frame with its chunks.
struct FrameShape {
  int width_px = 0, height_px = 0;
  std::int64_t payload_bytes = 0;
};

// GigE Vision action commands that fire these cameras: both keys must be the same, the masks share a bit.
struct ActionKeys {
  std::uint32_t device_key = 1, group_key = 1, group_mask = 1;
  std::string broadcast_address = {};  // one packet for all, e.g. 192.168.7.255; empty: one to each camera
};

struct SensorRegion {
  int offset_x_px = 0, offset_y_px = 0;
  int width_px = 0, height_px = 0;
};

// What every camera of an array is set to; each value is read back from the camera.
struct CameraSettings {
  std::string trigger_source = "Line1";             // or Software, Action1
  std::optional<ActionKeys> action = std::nullopt;  // with Action1
  std::string trigger_activation = "RisingEdge";
  int trigger_delay_us = 0;                    // from the edge to the exposure, [0, 1000000]
  int exposure_us = 350;                       // [4, 1000000]
  std::optional<int> gain_raw = std::nullopt;  // camera's own steps; none: left as it is
  std::optional<int> black_level_raw = std::nullopt;
  int binning_x = 1, binning_y = 1;  // pixels whose charges are added, [1, 4]
  bool test_image = false;           // the camera's own pattern instead of the scene
  PixelFormat pixel_format = PixelFormat::Mono8;
  std::optional<SensorRegion> region = std::nullopt;  // none: all of the sensor
  int packet_size_bytes = 1500;                       // IP and UDP headers included, [220, 16404]
  std::int64_t packet_delay_ns = 0;                   // between two packets of a frame
  int buffers = 16;                   // frames that may wait for the camera's thread, [2, 1000]
  int socket_buffer_bytes = 8 << 20;  // of the kernel; less where it allows less
};

// InvalidInput names the value that is out of range.
Result<> validate(const CameraSettings& settings);

}  // namespace flamefield
