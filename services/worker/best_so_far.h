#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace flamefield {

// The best field of an evolution that is still going on: a volume that the worker renews every few seconds
// and removes at the end. Named like other files of an attempt (staged_path), so that the dispatcher clears
// up after a worker that was killed.
struct BestSoFar {
  std::string run_id;
  std::filesystem::path path;
};

std::filesystem::path best_so_far_path(const std::filesystem::path& data_dir, std::string_view run_id,
                                       std::int64_t token);

// One of them, if there is any.
std::optional<BestSoFar> find_best_so_far(const std::filesystem::path& data_dir);

}  // namespace flamefield
