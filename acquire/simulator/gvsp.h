#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace flamefield {

// One picture on its way out, GigE Vision streaming protocol: leader, payload packets, trailer.
struct StreamFrame {
  std::int64_t pulse = 0;       // 0: none that a fault could be scripted for
  std::uint16_t frame_id = 0;   // 1..65535, never 0
  std::uint64_t timestamp = 0;  // ticks of the camera's clock
  std::uint32_t pixel_format = 0;
  std::uint32_t width_px = 0, height_px = 0, offset_x_px = 0, offset_y_px = 0;
  bool has_chunks = false;
  std::uint32_t packet_payload = 0;   // bytes of payload in one packet
  std::vector<std::uint8_t> payload;  // image, then chunks

  // Bytes of the payload that packet 1, 2, ... carries.
  std::span<const std::uint8_t> part(std::uint32_t packet) const {
    const std::size_t begin = std::size_t{packet - 1} * packet_payload;
    return std::span(payload).subspan(begin, std::min<std::size_t>(packet_payload, payload.size() - begin));
  }
  std::uint32_t packets() const {
    return static_cast<std::uint32_t>(2 + (payload.size() + packet_payload - 1) / packet_payload);
  }
};

// IP, UDP and GVSP headers of a packet; what is left of the packet size carries payload.
inline constexpr std::uint32_t kStreamOverhead = 20 + 8 + 8;

// Chunk layout of GigE Vision: data, id, length; a client reads them from the end.
void append_chunk(std::vector<std::uint8_t>& payload, std::uint32_t id, std::span<const std::uint8_t> data);

// Packet number `packet` (0 = leader, packets() - 1 = trailer) as it goes on the wire, without IP and UDP.
void encode_packet(const StreamFrame& frame, std::uint32_t packet, std::vector<std::uint8_t>& out);
// The 8 bytes before the part() of a payload packet.
std::array<std::uint8_t, 8> payload_header(const StreamFrame& frame, std::uint32_t packet);
// The answer to a resend request for what is no longer there.
void encode_unavailable(std::uint16_t frame_id, std::uint32_t packet, std::vector<std::uint8_t>& out);

}  // namespace flamefield
