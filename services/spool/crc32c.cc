#include "services/spool/crc32c.h"

#if defined(__x86_64__)
#include <nmmintrin.h>
#endif

#include <array>
#include <cstring>

namespace flamefield {

namespace {

// Slicing by 8: table k advances the register over one byte followed by k zero bytes.
using Tables = std::array<std::array<std::uint32_t, 256>, 8>;

constexpr Tables make_tables() {
  Tables tables{};
  for (std::uint32_t i = 0; i < 256; ++i) {
    std::uint32_t value = i;
    for (int bit = 0; bit < 8; ++bit) value = (value >> 1) ^ ((value & 1) != 0 ? 0x82f63b78u : 0u);
    tables[0][i] = value;
  }
  for (std::size_t k = 1; k < 8; ++k) {
    for (std::size_t i = 0; i < 256; ++i)
      tables[k][i] = (tables[k - 1][i] >> 8) ^ tables[0][tables[k - 1][i] & 255];
  }
  return tables;
}

constexpr Tables kTables = make_tables();

// The register after these bytes, by tables.
std::uint32_t advance_by_tables(std::uint32_t crc, const std::byte* p, std::size_t left) {
  for (; left >= 8; left -= 8, p += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, p, 8);  // little-endian machines only, like the file format
    word ^= crc;
    crc = 0;
    for (std::size_t k = 0; k < 8; ++k) crc ^= kTables[7 - k][(word >> (8 * k)) & 255];
  }
  for (; left > 0; --left, ++p) crc = (crc >> 8) ^ kTables[0][(crc ^ static_cast<std::uint32_t>(*p)) & 255];
  return crc;
}

#if defined(__x86_64__)
// The same by the instruction that was made for it.
__attribute__((target("sse4.2"))) std::uint32_t advance_by_instruction(std::uint32_t crc, const std::byte* p,
                                                                       std::size_t left) {
  std::uint64_t wide = crc;
  for (; left >= 8; left -= 8, p += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, p, 8);
    wide = _mm_crc32_u64(wide, word);
  }
  crc = static_cast<std::uint32_t>(wide);
  for (; left > 0; --left, ++p) crc = _mm_crc32_u8(crc, static_cast<unsigned char>(*p));
  return crc;
}
const bool kHasInstruction = __builtin_cpu_supports("sse4.2") != 0;
#else
const bool kHasInstruction = false;
std::uint32_t advance_by_instruction(std::uint32_t crc, const std::byte*, std::size_t) {
  return crc;
}
#endif

}  // namespace

std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t crc) {
  return ~(kHasInstruction ? advance_by_instruction(~crc, bytes.data(), bytes.size())
                           : advance_by_tables(~crc, bytes.data(), bytes.size()));
}

std::uint32_t crc32c_by_tables(std::span<const std::byte> bytes, std::uint32_t crc) {
  return ~advance_by_tables(~crc, bytes.data(), bytes.size());
}

}  // namespace flamefield
