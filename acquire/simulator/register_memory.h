#pragma once

#include <cstdint>
#include <mutex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace flamefield {

// 64 KiB of big-endian registers with the GenICam file behind them. Safe to share between threads.
class RegisterMemory {
 public:
  explicit RegisterMemory(std::string xml);

  // False, and nothing done, when the range is not all inside.
  bool read(std::uint32_t address, std::span<std::uint8_t> into) const;
  bool write(std::uint32_t address, std::span<const std::uint8_t> bytes);

  // Registers of the camera itself; the address must be inside.
  std::uint32_t get(std::uint32_t address) const;
  void set(std::uint32_t address, std::uint32_t value);
  // Text padded with zeros to `size` bytes, always ended by one.
  void set_text(std::uint32_t address, std::size_t size, std::string_view text);

  std::size_t xml_size() const { return xml_.size(); }

 private:
  mutable std::mutex mutex_;
  std::vector<std::uint8_t> bytes_;
  const std::string xml_;
};

}  // namespace flamefield
