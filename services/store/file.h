#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>
#include <string_view>

#include "proto/error.h"

namespace flamefield {

// A file that appears under its name complete and on the disk, or not at all: it is written under a temporary
// name in the same folder, synced and renamed. Destroyed without commit(), it leaves nothing behind.
class AtomicFile {
 public:
  // InvalidInput when the folder does not exist or cannot be written, or when `path` names something else
  // than a regular file.
  static Result<AtomicFile> create(const std::filesystem::path& path);
  AtomicFile(AtomicFile&& other) noexcept;
  AtomicFile& operator=(AtomicFile&&) = delete;
  ~AtomicFile();

  // For libraries that open files by name.
  const std::filesystem::path& temporary_path() const { return temporary_; }
  Result<> write(std::span<const std::byte> bytes);
  Result<> write(std::string_view text) { return write(std::as_bytes(std::span(text))); }
  Result<> commit();

 private:
  AtomicFile(std::filesystem::path path, std::filesystem::path temporary, int descriptor);
  std::filesystem::path path_, temporary_;
  int descriptor_ = -1;
};

// Whether an output could be written, asked before hours of work go into it. Leaves nothing behind.
Result<> check_writable(const std::filesystem::path& path);

Result<> write_text_file(const std::filesystem::path& path, std::string_view text);

struct InputFile {
  std::ifstream stream;
  std::uint64_t size_bytes = 0;
};
// NotFound when there is no such regular file, or it cannot be read.
Result<InputFile> open_input(const std::filesystem::path& path);

// InvalidInput when the file is larger than `limit_bytes`.
Result<std::string> read_text_file(const std::filesystem::path& path, std::uint64_t limit_bytes = 64u << 20);

}  // namespace flamefield
