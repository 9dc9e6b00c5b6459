#pragma once

#include <filesystem>
#include <string>

#include "proto/error.h"

namespace flamefield {

// A folder that lives as long as this object: scripts and data of one plot.
class ScratchFolder {
 public:
  ScratchFolder();  // throws std::system_error when the system's temporary folder is full or read-only
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

// Runs gnuplot (no shell, default settings) in `folder` on a script; returns what it wrote to standard
// output. Unavailable: gnuplot is not installed. InvalidInput: gnuplot's own complaint about the script.
Result<std::string> run_gnuplot(const std::string& script, const std::filesystem::path& folder);

}  // namespace flamefield
