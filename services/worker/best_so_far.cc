#include "services/worker/best_so_far.h"

#include "proto/job.h"

namespace flamefield {

namespace {
constexpr std::string_view kMark = ".best";
}

std::filesystem::path best_so_far_path(const std::filesystem::path& data_dir, std::string_view run_id,
                                       std::int64_t token) {
  return data_dir / "volumes" / staged_path(concat(run_id, kMark, ".vtkhdf"), token);
}

std::optional<BestSoFar> find_best_so_far(const std::filesystem::path& data_dir) {
  std::error_code problem;
  for (const auto& entry : std::filesystem::directory_iterator(data_dir / "volumes", problem)) {
    const std::string name = entry.path().filename().string();
    const std::size_t end = name.find(concat(kMark, ".part-"));
    if (end != name.npos && entry.path().extension() == ".vtkhdf")
      return BestSoFar{name.substr(0, end), entry.path()};
  }
  return std::nullopt;
}

}  // namespace flamefield
