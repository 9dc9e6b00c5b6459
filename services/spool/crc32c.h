#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace flamefield {

// CRC-32C (Castagnoli, RFC 3720 appendix B.4). Pass the last value to go on with more bytes.
std::uint32_t crc32c(std::span<const std::byte> bytes, std::uint32_t crc = 0);

// The plain version, for machines without the instruction, and the oracle of the other one.
std::uint32_t crc32c_by_tables(std::span<const std::byte> bytes, std::uint32_t crc = 0);

}  // namespace flamefield
