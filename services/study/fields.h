#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "proto/volume.h"

namespace flamefield {

// Known fields from files, each read once and shared by all runs and threads.
class FieldFiles {
 public:
  struct Field {
    Volume volume;
    std::string fingerprint;  // of its voxels
  };
  // spacing_mm: of a file without coordinates (.npy). InvalidInput: negative, NaN or infinite voxels, or a
  // field that is dark everywhere; and what read_volume says.
  Result<std::shared_ptr<const Field>> get(const std::filesystem::path& path,
                                           std::optional<double> spacing_mm);

 private:
  std::mutex mutex_;
  std::map<std::pair<std::string, double>, std::shared_ptr<const Field>> known_;
};

}  // namespace flamefield
