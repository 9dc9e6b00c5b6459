#include "services/spool/record.h"

#include <unistd.h>

#include <bit>

#include "proto/codec.h"
#include "services/spool/crc32c.h"

namespace flamefield {

static_assert(std::endian::native == std::endian::little, "the format is little-endian");

namespace {

constexpr std::uint64_t kMaxPayloadBytes = std::uint64_t{kMaxFrameBytes} * kMaxCameras;

// The part of the head that the checksum covers.
std::span<const std::byte> checked_part(const RecordHead& head) {
  return std::as_bytes(std::span(&head, 1)).subspan(2 * sizeof(std::uint32_t));
}

bool read_fully(int descriptor, std::span<std::byte> out, std::uint64_t offset) {
  while (!out.empty()) {
    const ssize_t n = ::pread(descriptor, out.data(), out.size(), static_cast<off_t>(offset));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return false;
    out = out.subspan(static_cast<std::size_t>(n));
    offset += static_cast<std::uint64_t>(n);
  }
  return true;
}

tl::unexpected<Error> damaged(std::uint32_t segment, std::uint64_t offset, std::string_view why) {
  return data_loss(concat("record at byte ", offset, " of spool segment ", segment), why,
                   "count the set as lost; check the disk");
}

// Cuts the payload into the frames that the header announces.
Result<> cut_payload(FrameSet& set, std::span<const std::byte> payload) {
  std::vector<Bytes> parts;
  for (const Frame& frame : set.frames) {
    const std::size_t n = bytes_of_image(frame.format, frame.width_px, frame.height_px);
    if (n > payload.size()) break;
    parts.push_back(std::make_shared<const std::vector<std::byte>>(
        payload.begin(), payload.begin() + static_cast<std::ptrdiff_t>(n)));
    payload = payload.subspan(n);
  }
  return attach_frames(set, std::move(parts));
}

}  // namespace

RecordHead sizes_of(const std::string& header, const FrameSet& set) {
  RecordHead head{kRecordMagic, 0, 0, static_cast<std::uint32_t>(header.size()), 0};
  for (const Frame& frame : set.frames) head.payload_bytes += frame.bytes->size();
  return head;
}

RecordHead make_head(std::uint32_t segment, const std::string& header, const FrameSet& set) {
  RecordHead head = sizes_of(header, set);
  head.segment = segment;
  head.crc = crc32c(checked_part(head));
  head.crc = crc32c(std::as_bytes(std::span(header)), head.crc);
  for (const Frame& frame : set.frames) head.crc = crc32c(*frame.bytes, head.crc);
  return head;
}

std::uint64_t record_length(const RecordHead& head) {
  return (sizeof head + head.header_bytes + head.payload_bytes + 7) / 8 * 8;
}

Result<Record> read_record(int descriptor, std::uint32_t segment, std::uint64_t offset, std::uint64_t size) {
  RecordHead head;
  if (offset > size || size - offset < sizeof head ||
      !read_fully(descriptor, std::as_writable_bytes(std::span(&head, 1)), offset))
    return damaged(segment, offset, "the segment ends there");
  if (head.magic != kRecordMagic || head.segment != segment)
    return damaged(segment, offset, "no record there");
  if (head.header_bytes > kMaxHeaderBytes || head.payload_bytes > kMaxPayloadBytes ||
      record_length(head) > size - offset)
    return damaged(segment, offset, "its length is impossible");
  std::vector<std::byte> bytes(head.header_bytes + head.payload_bytes);
  if (!read_fully(descriptor, bytes, offset + sizeof head))
    return damaged(segment, offset, "it cannot be read");
  if (crc32c(bytes, crc32c(checked_part(head))) != head.crc)
    return damaged(segment, offset, "its checksum is wrong");
  const auto header = std::span(bytes).first(head.header_bytes);
  auto envelope = decode(header);
  auto* put = envelope ? std::get_if<PutSet>(&envelope->message) : nullptr;
  if (!put) return damaged(segment, offset, "its header is not a frame set");
  if (!cut_payload(put->set, std::span(bytes).subspan(head.header_bytes)))
    return damaged(segment, offset, "its pixels do not match its header");
  return Record{std::move(put->set), record_length(head)};
}

}  // namespace flamefield
