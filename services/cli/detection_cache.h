#pragma once

#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "calibrate/detect.h"

namespace flamefield {

// Corners that were found before, by the content of the picture and the board: a session that grows, or is
// solved again with other settings, searches each picture once.
class DetectionCache {
 public:
  // Empty when the file does not exist or is not such a file: it is a convenience, and is written anew.
  static DetectionCache read(const std::filesystem::path& path);
  Result<> write(const std::filesystem::path& path) const;

  // detect(), but only for pictures that the cache lacks; it has them afterwards.
  Result<std::vector<Detection>> detect(std::span<const BoardView> views, const BoardSpec& board,
                                        const DetectOptions& options);

 private:
  struct Entry {
    std::vector<Eigen::Vector2d> corners_px;
    std::string reason;
  };
  std::map<std::string, Entry> entries_;
};

}  // namespace flamefield
