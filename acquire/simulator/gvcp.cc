#include "acquire/simulator/gvcp.h"

#include "acquire/simulator/big_endian.h"

namespace flamefield {

namespace {

constexpr std::uint8_t kKey = 0x42;
constexpr std::size_t kHeaderSize = 8;
constexpr std::uint32_t kPacketIdMask = 0x00ffffff;

}  // namespace

std::optional<GvcpCommand> decode_gvcp(std::span<const std::uint8_t> packet) {
  if (packet.size() < kHeaderSize || packet[0] != kKey) return std::nullopt;
  const std::size_t size = load_u16(packet.data() + 4);
  const std::uint16_t request_id = load_u16(packet.data() + 6);
  if (packet.size() < kHeaderSize + size || request_id == 0) return std::nullopt;
  return GvcpCommand{.code = static_cast<GvcpCode>(load_u16(packet.data() + 2)),
                     .wants_acknowledge = (packet[1] & 1) != 0,
                     .is_scheduled = (packet[1] & 0x80) != 0,
                     .request_id = request_id,
                     .payload = packet.subspan(kHeaderSize, size)};
}

std::optional<std::vector<std::uint32_t>> decode_read_registers(std::span<const std::uint8_t> payload) {
  if (payload.empty() || payload.size() % 4 != 0 || payload.size() > kMaxMemoryBlock) return std::nullopt;
  std::vector<std::uint32_t> addresses;
  for (std::size_t at = 0; at < payload.size(); at += 4) addresses.push_back(load_u32(payload.data() + at));
  return addresses;
}

std::optional<std::vector<RegisterWrite>> decode_write_registers(std::span<const std::uint8_t> payload) {
  if (payload.empty() || payload.size() % 8 != 0 || payload.size() > kMaxMemoryBlock) return std::nullopt;
  std::vector<RegisterWrite> writes;
  for (std::size_t at = 0; at < payload.size(); at += 8) {
    writes.push_back({load_u32(payload.data() + at), load_u32(payload.data() + at + 4)});
  }
  return writes;
}

std::optional<MemoryRange> decode_read_memory(std::span<const std::uint8_t> payload) {
  if (payload.size() != 8) return std::nullopt;
  const MemoryRange range{load_u32(payload.data()), load_u16(payload.data() + 6)};
  if (range.size == 0 || range.size > kMaxMemoryBlock) return std::nullopt;
  return range;
}

std::optional<ResendRequest> decode_resend(std::span<const std::uint8_t> payload) {
  if (payload.size() < 12) return std::nullopt;
  const ResendRequest request{load_u16(payload.data() + 2), load_u32(payload.data() + 4) & kPacketIdMask,
                              load_u32(payload.data() + 8) & kPacketIdMask};
  if (request.last_packet < request.first_packet) return std::nullopt;
  return request;
}

std::optional<ActionCommand> decode_action(const GvcpCommand& command) {
  const auto payload = command.payload;
  if (payload.size() < (command.is_scheduled ? 20 : 12)) return std::nullopt;
  ActionCommand action{load_u32(payload.data()), load_u32(payload.data() + 4), load_u32(payload.data() + 8)};
  if (command.is_scheduled)
    action.ticks = std::uint64_t{load_u32(payload.data() + 12)} << 32 | load_u32(payload.data() + 16);
  return action;
}

std::vector<std::uint8_t> encode_acknowledge(const GvcpCommand& command, GvcpStatus status,
                                             std::span<const std::uint8_t> payload) {
  std::vector<std::uint8_t> out;
  out.reserve(kHeaderSize + payload.size());
  append_u16(out, static_cast<std::uint16_t>(status));
  append_u16(out, static_cast<std::uint32_t>(command.code) + 1u);
  append_u16(out, static_cast<std::uint32_t>(payload.size()));
  append_u16(out, command.request_id);
  out.insert(out.end(), payload.begin(), payload.end());
  return out;
}

}  // namespace flamefield
