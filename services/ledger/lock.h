#pragma once

#include <filesystem>

#include "proto/error.h"

namespace flamefield {

// Holds an exclusive lock on a file for as long as it lives; the kernel drops it when the process dies.
class FileLock {
 public:
  // Unavailable, naming the process that holds it.
  static Result<FileLock> take(const std::filesystem::path& path);
  FileLock(FileLock&& other) noexcept;
  FileLock& operator=(FileLock&&) = delete;
  ~FileLock();

 private:
  explicit FileLock(int descriptor) : descriptor_(descriptor) {}
  int descriptor_ = -1;
};

}  // namespace flamefield
