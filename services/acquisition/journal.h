#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "proto/message.h"

namespace flamefield {

// A note of the capture under way that outlives its program: what was started and how many pulses were seen,
// written again with every set. A program that was killed finds it when it starts again, and can say what
// became of the capture. Two slots in turn, each with a checksum: a torn one is not read. Survives the death
// of the process, not of the machine: it is not synced, so that it never waits for a disk.
class CaptureJournal {
 public:
  // An empty path: nothing is kept. Unavailable: the file cannot be made.
  static Result<CaptureJournal> open(const std::filesystem::path& path);
  CaptureJournal(CaptureJournal&& other) noexcept;
  CaptureJournal& operator=(CaptureJournal&&) = delete;
  ~CaptureJournal();

  // The capture that was under way when the last program ended; none: it had closed all.
  const std::optional<PutCapture>& left_behind() const { return left_behind_; }
  void note(const PutCapture& capture);
  void clear();  // the capture is closed

 private:
  CaptureJournal() = default;
  int descriptor_ = -1;
  std::uint64_t writes_ = 0;
  std::optional<PutCapture> left_behind_;
};

}  // namespace flamefield
