#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace flamefield {

// GigE Vision control protocol, the camera's side: bytes from outside become commands here or nowhere.
enum class GvcpCode : std::uint16_t {
  Discovery = 0x0002,
  PacketResend = 0x0040,
  ReadRegisters = 0x0080,
  WriteRegisters = 0x0082,
  ReadMemory = 0x0084,
  WriteMemory = 0x0086,
  Action = 0x0100,
};

enum class GvcpStatus : std::uint16_t {
  Success = 0x0000,
  NotImplemented = 0x8001,
  InvalidParameter = 0x8002,
  InvalidAddress = 0x8003,
  WriteProtect = 0x8004,
  BadAlignment = 0x8005,
  AccessDenied = 0x8006,
};

struct GvcpCommand {
  GvcpCode code{};
  bool wants_acknowledge = false;
  bool is_scheduled = false;  // an action that carries its time
  std::uint16_t request_id = 0;
  std::span<const std::uint8_t> payload;  // into the received packet
};

// None unless the packet has the right key, a request id, and is as long as its header says.
std::optional<GvcpCommand> decode_gvcp(std::span<const std::uint8_t> packet);

struct RegisterWrite {
  std::uint32_t address = 0;
  std::uint32_t value = 0;
};
// Payloads of the commands; none when a length does not fit.
std::optional<std::vector<std::uint32_t>> decode_read_registers(std::span<const std::uint8_t> payload);
std::optional<std::vector<RegisterWrite>> decode_write_registers(std::span<const std::uint8_t> payload);

struct MemoryRange {
  std::uint32_t address = 0;
  std::uint16_t size = 0;
};
inline constexpr std::size_t kMaxMemoryBlock = 536;  // bytes in one READMEM or WRITEMEM
std::optional<MemoryRange> decode_read_memory(std::span<const std::uint8_t> payload);

struct ResendRequest {
  std::uint16_t frame_id = 0;
  std::uint32_t first_packet = 0;
  std::uint32_t last_packet = 0;
};
std::optional<ResendRequest> decode_resend(std::span<const std::uint8_t> payload);

// Fires every camera whose keys are the same and whose mask shares a bit.
struct ActionCommand {
  std::uint32_t device_key = 0;
  std::uint32_t group_key = 0;
  std::uint32_t group_mask = 0;
  std::optional<std::uint64_t> ticks = std::nullopt;  // of the camera's clock; none: at once
};
std::optional<ActionCommand> decode_action(const GvcpCommand& command);

std::vector<std::uint8_t> encode_acknowledge(const GvcpCommand& command, GvcpStatus status,
                                             std::span<const std::uint8_t> payload);

}  // namespace flamefield
