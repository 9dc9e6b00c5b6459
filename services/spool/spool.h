#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "proto/frame.h"

namespace flamefield {

// Where a set lies: bytes [offset, offset + length) of a segment.
struct SpoolLocation {
  std::uint32_t segment = 0;
  std::uint64_t offset = 0;
  std::uint64_t length = 0;
  auto operator<=>(const SpoolLocation&) const = default;
};

struct SpoolOptions {
  std::filesystem::path directory;
  std::uint64_t segment_bytes = 256u << 20;  // a larger set gets a segment of its own
};

// A set that a crash left in the spool but not in the ledger. Its frames have no pixels; read() has.
struct RecoveredSet {
  FrameSet set;
  SpoolLocation location;
};

// Append-only store of raw frame sets; the format is in README.md. One process, one thread.
class Spool {
 public:
  // Scans what lies behind `durable`, the last set that the ledger knows (all of it by default), and cuts a
  // torn record off. Unavailable: the directory cannot be written, or the disk is full.
  static Result<Spool> open(const SpoolOptions& options, const SpoolLocation& durable = {});
  Spool(Spool&& other) noexcept;
  Spool& operator=(Spool&&) = delete;
  ~Spool();

  const std::vector<RecoveredSet>& recovered() const { return recovered_; }

  // Written, but durable only after sync(). Unavailable: disk full; the spool stays as it was.
  Result<SpoolLocation> append(const FrameSet& set);
  Result<> sync();

  // DataLoss: the record does not match its checksum. NotFound: no such segment.
  Result<FrameSet> read(const SpoolLocation& location);

 private:
  explicit Spool(const SpoolOptions& options) : options_(options) {}
  std::filesystem::path path_of(std::uint32_t segment) const;
  Result<> start_segment(std::uint32_t segment, std::uint64_t bytes);
  Result<> recover(const SpoolLocation& durable);
  Result<std::uint64_t> scan(std::uint32_t segment, std::uint64_t from);
  Result<int> descriptor_of(std::uint32_t segment);

  SpoolOptions options_;
  std::uint32_t segment_ = 0;  // 0: none yet
  std::uint64_t tail_ = 0;     // where the next record goes
  std::uint64_t size_ = 0;     // of the current segment
  bool unsynced_ = false;
  bool broken_ = false;
  std::map<std::uint32_t, int> descriptors_;
  std::vector<RecoveredSet> recovered_;
};

}  // namespace flamefield
