#pragma once

#include <cstdint>
#include <string>

#include "proto/frame.h"

namespace flamefield {

// The fixed part of a record, as it lies on disk (little-endian).
struct RecordHead {
  std::uint32_t magic = 0;
  std::uint32_t crc = 0;
  std::uint32_t segment = 0;
  std::uint32_t header_bytes = 0;
  std::uint64_t payload_bytes = 0;
};
static_assert(sizeof(RecordHead) == 24);

inline constexpr std::uint32_t kRecordMagic = 0x31525346;  // "FSR1"

RecordHead sizes_of(const std::string& header, const FrameSet& set);  // without checksum and segment
std::uint64_t record_length(const RecordHead& head);                  // with padding
RecordHead make_head(std::uint32_t segment, const std::string& header, const FrameSet& set);

// The record at `offset` of an open segment of `size` bytes. DataLoss when there is no whole, intact one.
struct Record {
  FrameSet set;
  std::uint64_t length = 0;
};
Result<Record> read_record(int descriptor, std::uint32_t segment, std::uint64_t offset, std::uint64_t size);

}  // namespace flamefield
