#pragma once

#include <filesystem>

#include "services/spool/spool.h"

namespace flamefield {

// Reads stored sets while another process may be appending. One thread.
class SpoolReader {
 public:
  explicit SpoolReader(std::filesystem::path directory) : directory_(std::move(directory)) {}
  SpoolReader(const SpoolReader&) = delete;
  ~SpoolReader();

  // DataLoss: the record does not match its checksum. NotFound: no such segment.
  Result<FrameSet> read(const SpoolLocation& location);

 private:
  std::filesystem::path directory_;
  std::uint32_t segment_ = 0;  // the one that is open
  int descriptor_ = -1;
};

}  // namespace flamefield
