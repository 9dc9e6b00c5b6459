#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"

namespace flamefield {

enum class PixelFormat { Mono8, Mono12, Mono12Packed, Mono16 };  // Mono12: 12 bits in 16, little-endian

int bits_of(PixelFormat format);
std::string_view name_of(PixelFormat format);
std::optional<PixelFormat> pixel_format_from_name(std::string_view name);
std::size_t bytes_of_image(PixelFormat format, int width_px, int height_px);

// One camera's picture of one pulse. The bytes are shared, never copied on the way to the spool.
struct Frame {
  std::string camera;
  std::int64_t pulse = 0;            // number of the trigger pulse that exposed it
  std::int64_t device_time_ns = 0;   // the camera's own clock
  std::int64_t arrival_time_ns = 0;  // UTC, when the last packet was here
  int exposure_us = 0;
  int width_px = 0;
  int height_px = 0;
  PixelFormat format = PixelFormat::Mono8;
  std::shared_ptr<const std::vector<std::byte>> bytes;
};

// Unpacked grey levels as the sensor gave them. InvalidInput when the bytes do not match the size.
Result<Image> grey_levels(const Frame& frame);

// Why a camera has no frame in a set.
enum class LossCause { Missed, Incomplete, Late, Duplicate, CameraLost, NoBuffer, Corrupt };
std::string_view name_of(LossCause cause);
std::optional<LossCause> loss_cause_from_name(std::string_view name);

struct FrameLoss {
  std::string camera;
  LossCause cause = LossCause::Missed;
};

enum class CaptureKind { Dark, Background, Flat, Board, Burst, Live };
std::string_view name_of(CaptureKind kind);
std::optional<CaptureKind> capture_kind_from_name(std::string_view name);

// What all cameras saw of one pulse: frames plus losses make one entry per camera of the array.
struct FrameSet {
  std::string capture;  // which capture it belongs to, e.g. "20260301T101500-burst"
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulse = 0;             // number of the pulse since the array was armed
  std::int64_t index = 0;             // number of the set in its capture, from 0
  std::int64_t pulse_time_ns = 0;     // UTC, best estimate of the trigger edge
  std::int64_t complete_time_ns = 0;  // UTC, when the set was assembled
  std::vector<Frame> frames;
  std::vector<FrameLoss> losses;
};

}  // namespace flamefield
