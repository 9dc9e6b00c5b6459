#include "acquire/simulator/test_image.h"

#include <array>
#include <cstring>

namespace flamefield {

namespace {

constexpr std::size_t kStampBytes = 16;  // one pixel each, in its upper 8 bits
constexpr std::uint8_t kMagic = 0xf1;

using StampBytes = std::array<std::uint8_t, kStampBytes>;

std::uint8_t checksum(const StampBytes& bytes) {
  std::uint8_t sum = 0x5a;
  for (std::size_t i = 0; i + 1 < kStampBytes; ++i) sum = static_cast<std::uint8_t>(sum * 31 + bytes[i]);
  return sum;
}

StampBytes encode(const ImageStamp& stamp) {
  StampBytes out{};
  out[0] = kMagic;
  out[1] = stamp.is_stray ? 1 : 0;
  for (std::size_t i = 0; i < 4; ++i) out[2 + i] = static_cast<std::uint8_t>(stamp.camera >> 8 * i);
  for (std::size_t i = 0; i < 8; ++i)
    out[6 + i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(stamp.pulse) >> 8 * i);
  out[15] = checksum(out);
  return out;
}

std::optional<ImageStamp> decode(const StampBytes& bytes) {
  if (bytes[0] != kMagic || bytes[15] != checksum(bytes)) return std::nullopt;
  ImageStamp stamp;
  stamp.is_stray = bytes[1] == 1;
  std::uint64_t pulse = 0;
  for (std::size_t i = 0; i < 4; ++i) stamp.camera |= std::size_t{bytes[2 + i]} << 8 * i;
  for (std::size_t i = 0; i < 8; ++i) pulse |= std::uint64_t{bytes[6 + i]} << 8 * i;
  stamp.pulse = static_cast<std::int64_t>(pulse);
  return stamp;
}

// Where the upper 8 bits of a pixel are on the wire.
std::size_t byte_of_pixel(PixelFormat format, std::size_t pixel) {
  switch (format) {
    case PixelFormat::Mono8:
      return pixel;
    case PixelFormat::Mono12Packed:
      return pixel / 2 * 3 + (pixel % 2 == 0 ? 0 : 2);
    case PixelFormat::Mono12:
    case PixelFormat::Mono16:
      break;
  }
  return 2 * pixel + 1;
}

// 12 bits in 16 put the upper bits elsewhere: of Mono12 the stamp is 4 bits lower.
void put(PixelFormat format, std::size_t pixel, std::uint8_t value, std::uint8_t* bytes) {
  if (format != PixelFormat::Mono12) {
    bytes[byte_of_pixel(format, pixel)] = value;
    return;
  }
  bytes[2 * pixel] = static_cast<std::uint8_t>(value << 4);
  bytes[2 * pixel + 1] = static_cast<std::uint8_t>(value >> 4);
}

std::uint8_t get(PixelFormat format, std::size_t pixel, const std::uint8_t* bytes) {
  if (format != PixelFormat::Mono12) return bytes[byte_of_pixel(format, pixel)];
  return static_cast<std::uint8_t>(bytes[2 * pixel] >> 4 | bytes[2 * pixel + 1] << 4);
}

std::vector<std::uint8_t> ramp(PixelFormat format, int width_px, int height_px) {
  std::vector<std::uint8_t> out(bytes_of_image(format, width_px, height_px), 0);
  std::size_t pixel = 0;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x, ++pixel)
      put(format, pixel, static_cast<std::uint8_t>(x + y), out.data());
  }
  return out;
}

}  // namespace

std::vector<std::uint8_t> TestImage::expose(const Sensor::Readout& readout, const ImageStamp& stamp) {
  if (ramp_.empty() || readout.format != readout_.format || readout.width_px != readout_.width_px ||
      readout.height_px != readout_.height_px) {
    readout_ = readout;
    ramp_ = ramp(readout.format, readout.width_px, readout.height_px);
  }
  std::vector<std::uint8_t> out = ramp_;
  const StampBytes bytes = encode(stamp);
  const auto pixels =
      static_cast<std::size_t>(readout.width_px) * static_cast<std::size_t>(readout.height_px);
  for (std::size_t i = 0; i < kStampBytes && i < pixels; ++i) put(readout.format, i, bytes[i], out.data());
  return out;
}

std::optional<ImageStamp> read_test_image(const Frame& frame) {
  const auto pixels = static_cast<std::size_t>(frame.width_px) * static_cast<std::size_t>(frame.height_px);
  if (!frame.bytes || pixels < kStampBytes ||
      frame.bytes->size() != bytes_of_image(frame.format, frame.width_px, frame.height_px)) {
    return std::nullopt;
  }
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(frame.bytes->data());
  StampBytes stamp;
  for (std::size_t i = 0; i < kStampBytes; ++i) stamp[i] = get(frame.format, i, bytes);
  const auto decoded = decode(stamp);
  if (!decoded) return std::nullopt;
  thread_local TestImage image;
  const auto expected = image.expose(
      {.format = frame.format, .width_px = frame.width_px, .height_px = frame.height_px}, *decoded);
  if (std::memcmp(expected.data(), bytes, expected.size()) != 0) return std::nullopt;
  return decoded;
}

}  // namespace flamefield
