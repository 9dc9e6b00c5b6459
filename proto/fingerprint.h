#pragma once

#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <type_traits>

namespace flamefield {

// FNV-1a, 64 bits: names of rigs and recipes. Not for security.
class Fingerprint {
 public:
  void add(std::span<const std::byte> bytes) {
    for (std::byte b : bytes) hash_ = (hash_ ^ static_cast<std::uint64_t>(b)) * 0x100000001b3ull;
  }
  void add(const std::string& text) {
    add(std::as_bytes(std::span(text)));
    add(static_cast<std::uint64_t>(text.size()));
  }
  template <class T>
  requires std::is_arithmetic_v<T>
  void add(T value) { add(std::as_bytes(std::span<const T, 1>(&value, 1))); }
  std::uint64_t value() const { return hash_; }
  std::string text() const {
    static constexpr char kDigits[] = "0123456789abcdef";
    std::string out(16, '0');
    for (std::size_t i = 0; i < 16; ++i) out[15 - i] = kDigits[(hash_ >> (4 * i)) & 15];
    return out;
  }

 private:
  std::uint64_t hash_ = 0xcbf29ce484222325ull;
};

}  // namespace flamefield
