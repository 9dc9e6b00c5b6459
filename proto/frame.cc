#include "proto/frame.h"

#include <array>
#include <cstring>

namespace flamefield {

namespace {

struct FormatRow {
  PixelFormat format;
  std::string_view name;
  int bits;
};
constexpr std::array kFormats = {
    FormatRow{PixelFormat::Mono8, "Mono8", 8}, FormatRow{PixelFormat::Mono12, "Mono12", 12},
    FormatRow{PixelFormat::Mono12Packed, "Mono12Packed", 12}, FormatRow{PixelFormat::Mono16, "Mono16", 16}};

template <class Enum>
struct NameRow {
  Enum value;
  std::string_view name;
};
constexpr std::array kCauses = {NameRow<LossCause>{LossCause::Missed, "missed"},
                                NameRow<LossCause>{LossCause::Incomplete, "incomplete"},
                                NameRow<LossCause>{LossCause::Late, "late"},
                                NameRow<LossCause>{LossCause::Duplicate, "duplicate"},
                                NameRow<LossCause>{LossCause::CameraLost, "camera-lost"},
                                NameRow<LossCause>{LossCause::NoBuffer, "no-buffer"},
                                NameRow<LossCause>{LossCause::Corrupt, "corrupt"}};
constexpr std::array kKinds = {NameRow<CaptureKind>{CaptureKind::Dark, "dark"},
                               NameRow<CaptureKind>{CaptureKind::Background, "background"},
                               NameRow<CaptureKind>{CaptureKind::Flat, "flat"},
                               NameRow<CaptureKind>{CaptureKind::Board, "board"},
                               NameRow<CaptureKind>{CaptureKind::Burst, "burst"},
                               NameRow<CaptureKind>{CaptureKind::Live, "live"}};

template <class Rows, class Enum>
std::string_view find_name(const Rows& rows, Enum value) {
  for (const auto& row : rows) {
    if (row.value == value) return row.name;
  }
  return "unknown";
}
template <class Enum, class Rows>
std::optional<Enum> find_value(const Rows& rows, std::string_view name) {
  for (const auto& row : rows) {
    if (row.name == name) return row.value;
  }
  return std::nullopt;
}

const FormatRow& row_of(PixelFormat format) {
  for (const FormatRow& row : kFormats) {
    if (row.format == format) return row;
  }
  return kFormats[0];
}

}  // namespace

int bits_of(PixelFormat format) {
  return row_of(format).bits;
}
std::string_view name_of(PixelFormat format) {
  return row_of(format).name;
}
std::optional<PixelFormat> pixel_format_from_name(std::string_view name) {
  for (const FormatRow& row : kFormats) {
    if (row.name == name) return row.format;
  }
  return std::nullopt;
}

std::string_view name_of(LossCause cause) {
  return find_name(kCauses, cause);
}
std::optional<LossCause> loss_cause_from_name(std::string_view name) {
  return find_value<LossCause>(kCauses, name);
}
std::string_view name_of(CaptureKind kind) {
  return find_name(kKinds, kind);
}
std::optional<CaptureKind> capture_kind_from_name(std::string_view name) {
  return find_value<CaptureKind>(kKinds, name);
}

std::size_t bytes_of_image(PixelFormat format, int width_px, int height_px) {
  const auto pixels = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  switch (format) {
    case PixelFormat::Mono8:
      return pixels;
    case PixelFormat::Mono12Packed:
      return (pixels * 3 + 1) / 2;
    case PixelFormat::Mono12:
    case PixelFormat::Mono16:
      return pixels * 2;
  }
  return 0;
}

Result<Image> grey_levels(const Frame& frame) {
  const std::size_t wanted = bytes_of_image(frame.format, frame.width_px, frame.height_px);
  const std::size_t got = frame.bytes ? frame.bytes->size() : 0;
  if (frame.width_px <= 0 || frame.height_px <= 0 || got < wanted) {
    return invalid_input(
        concat("frame of ", frame.camera, ", pulse ", frame.pulse, ": ", got, " bytes"),
        concat(frame.width_px, "x", frame.height_px, " ", name_of(frame.format), " needs ", wanted),
        "count the frame as lost");
  }
  const auto* bytes = reinterpret_cast<const unsigned char*>(frame.bytes->data());
  if (frame.format == PixelFormat::Mono8) {  // most frames; written once, not cleared first
    Image image;
    image.width_px = frame.width_px;
    image.height_px = frame.height_px;
    image.pixels.assign(bytes, bytes + wanted);
    return image;
  }
  Image image(frame.width_px, frame.height_px);
  const std::size_t n = image.pixels.size();
  switch (frame.format) {
    case PixelFormat::Mono8:
      break;
    case PixelFormat::Mono12:
    case PixelFormat::Mono16:
      for (std::size_t i = 0; i < n; ++i)
        image.pixels[i] = static_cast<float>(bytes[2 * i] | bytes[2 * i + 1] << 8);
      break;
    case PixelFormat::Mono12Packed:
      // GigE Vision: byte 0 = high bits of pixel 0, byte 1 = low nibbles (0 then 1), byte 2 = high bits of
      // pixel 1.
      for (std::size_t i = 0; i < n; ++i) {
        const unsigned char* group = bytes + i / 2 * 3;
        image.pixels[i] =
            static_cast<float>(i % 2 == 0 ? group[0] << 4 | (group[1] & 15) : group[2] << 4 | group[1] >> 4);
      }
      break;
  }
  return image;
}

}  // namespace flamefield
