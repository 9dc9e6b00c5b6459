#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "proto/frame.h"

namespace flamefield {

// Codes of the pixel formats on the wire: GenICam Pixel Format Naming Convention 2.1, PFNC32.
struct PixelCode {
  PixelFormat format;
  std::uint32_t code;
};
inline constexpr std::array kPixelCodes = {
    PixelCode{PixelFormat::Mono8, 0x01080001}, PixelCode{PixelFormat::Mono12, 0x01100005},
    PixelCode{PixelFormat::Mono12Packed, 0x010c0006}, PixelCode{PixelFormat::Mono16, 0x01100007}};

// None for a code that is not one of ours.
constexpr std::optional<PixelFormat> pixel_format_from_code(std::uint32_t code) {
  for (const PixelCode& entry : kPixelCodes) {
    if (entry.code == code) return entry.format;
  }
  return std::nullopt;
}

}  // namespace flamefield
