#include "services/acquisition/journal.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "proto/codec.h"
#include "services/spool/crc32c.h"

namespace flamefield {

namespace {

constexpr std::size_t kSlot_bytes = 256 << 10;  // 256 cameras with all their counters fit
constexpr std::uint32_t kMagic = 0x314a4346;    // "FCJ1"

struct SlotHead {
  std::uint32_t magic = kMagic;
  std::uint32_t crc = 0;  // of what follows
  std::uint64_t number = 0;
  std::uint64_t bytes = 0;  // 0: no capture under way
};

std::uint32_t checksum(const SlotHead& head, std::span<const std::byte> message) {
  return crc32c(message, crc32c(std::as_bytes(std::span(&head, 1)).subspan(2 * sizeof(std::uint32_t))));
}

struct Slot {
  std::uint64_t number = 0;
  std::optional<PutCapture> capture;
};

std::optional<Slot> read_slot(int descriptor, off_t offset) {
  SlotHead head;
  if (::pread(descriptor, &head, sizeof head, offset) != sizeof head || head.magic != kMagic ||
      head.bytes > kSlot_bytes - sizeof head)
    return std::nullopt;
  std::vector<std::byte> message(head.bytes);
  const auto wanted = static_cast<ssize_t>(message.size());
  if (::pread(descriptor, message.data(), message.size(), offset + static_cast<off_t>(sizeof head)) !=
          wanted ||
      checksum(head, message) != head.crc)
    return std::nullopt;
  Slot slot{head.number, std::nullopt};
  if (message.empty()) return slot;
  auto envelope = decode(message);
  if (auto* capture = envelope ? std::get_if<PutCapture>(&envelope->message) : nullptr)
    slot.capture = std::move(*capture);
  return slot;
}

}  // namespace

Result<CaptureJournal> CaptureJournal::open(const std::filesystem::path& path) {
  CaptureJournal journal;
  if (path.empty()) return journal;
  std::error_code ignored;
  std::filesystem::create_directories(path.parent_path(), ignored);
  journal.descriptor_ = ::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644);
  if (journal.descriptor_ < 0) {
    return unavailable(concat("cannot open ", path.string()), std::strerror(errno),
                       "give the data directory to this user");
  }
  // Its room is there from the start: a full disk does not keep a capture from being noted.
  (void)::posix_fallocate(journal.descriptor_, 0, 2 * kSlot_bytes);
  for (off_t offset : {off_t{0}, off_t{kSlot_bytes}}) {
    auto slot = read_slot(journal.descriptor_, offset);
    if (!slot || slot->number < journal.writes_) continue;
    journal.writes_ = slot->number;
    journal.left_behind_ = std::move(slot->capture);
  }
  return journal;
}

CaptureJournal::CaptureJournal(CaptureJournal&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      writes_(other.writes_),
      left_behind_(std::move(other.left_behind_)) {}

CaptureJournal::~CaptureJournal() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

namespace {

void write_slot(int descriptor, std::uint64_t number, std::span<const std::byte> message) {
  SlotHead head;
  head.number = number;
  head.bytes = message.size();
  head.crc = checksum(head, message);
  std::vector<std::byte> slot(sizeof head + message.size());
  std::memcpy(slot.data(), &head, sizeof head);
  std::ranges::copy(message, slot.begin() + sizeof head);
  // What cannot be written is told by the other slot, one set older.
  (void)!::pwrite(descriptor, slot.data(), slot.size(), number % 2 == 0 ? 0 : off_t{kSlot_bytes});
}

}  // namespace

void CaptureJournal::note(const PutCapture& capture) {
  if (descriptor_ < 0) return;
  const std::string message = encode(capture);
  if (message.size() > kSlot_bytes - sizeof(SlotHead)) return;
  write_slot(descriptor_, ++writes_, std::as_bytes(std::span(message)));
}

void CaptureJournal::clear() {
  left_behind_.reset();
  if (descriptor_ >= 0) write_slot(descriptor_, ++writes_, {});
}

}  // namespace flamefield
