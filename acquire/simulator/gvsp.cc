#include "acquire/simulator/gvsp.h"

#include "acquire/simulator/big_endian.h"
#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::uint32_t kLeader = 1, kTrailer = 2, kPayload = 3;
constexpr std::uint32_t kImage = 0x0001, kChunkFlag = 0x4000;
constexpr std::uint32_t kStatusUnavailable = 0x800c;

void append_header(std::vector<std::uint8_t>& out, std::uint32_t status, std::uint16_t frame_id,
                   std::uint32_t kind, std::uint32_t packet) {
  append_u16(out, status);
  append_u16(out, frame_id);
  append_u32(out, kind << 24 | packet);
}

void append_leader(std::vector<std::uint8_t>& out, const StreamFrame& frame) {
  append_u16(out, 0);
  append_u16(out, frame.has_chunks ? kChunkFlag | kImage : kImage);
  append_u64(out, frame.timestamp);
  append_u32(out, frame.pixel_format);
  append_u32(out, frame.width_px);
  append_u32(out, frame.height_px);
  append_u32(out, frame.offset_x_px);
  append_u32(out, frame.offset_y_px);
  append_u32(out, 0);  // padding in x and y
}

}  // namespace

void append_chunk(std::vector<std::uint8_t>& payload, std::uint32_t id, std::span<const std::uint8_t> data) {
  payload.insert(payload.end(), data.begin(), data.end());
  append_u32(payload, id);
  append_u32(payload, static_cast<std::uint32_t>(data.size()));
}

void encode_packet(const StreamFrame& frame, std::uint32_t packet, std::vector<std::uint8_t>& out) {
  expect(packet < frame.packets(), "the packet belongs to the frame");
  out.clear();
  if (packet == 0) {
    append_header(out, 0, frame.frame_id, kLeader, packet);
    append_leader(out, frame);
  } else if (packet == frame.packets() - 1) {
    append_header(out, 0, frame.frame_id, kTrailer, packet);
    append_u32(out, kImage);
    append_u32(out, frame.height_px);
  } else {
    append_header(out, 0, frame.frame_id, kPayload, packet);
    const auto part = frame.part(packet);
    out.insert(out.end(), part.begin(), part.end());
  }
}

std::array<std::uint8_t, 8> payload_header(const StreamFrame& frame, std::uint32_t packet) {
  const auto byte = [](std::uint32_t value) { return static_cast<std::uint8_t>(value); };
  return {0,
          0,
          byte(std::uint32_t{frame.frame_id} >> 8),
          byte(frame.frame_id),
          byte(kPayload),
          byte(packet >> 16),
          byte(packet >> 8),
          byte(packet)};
}

void encode_unavailable(std::uint16_t frame_id, std::uint32_t packet, std::vector<std::uint8_t>& out) {
  out.clear();
  append_header(out, kStatusUnavailable, frame_id, kPayload, packet);
}

}  // namespace flamefield
