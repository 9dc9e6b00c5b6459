#include <algorithm>

#include "services/recording/recording.h"

namespace flamefield {

namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kBlock_sets = 16;

fs::path part_path(const fs::path& folder, std::int64_t block) {
  std::string number = std::to_string(block);
  if (number.size() < 6) number.insert(0, 6 - number.size(), '0');
  return folder / concat("part-", number, ".nxs");
}

}  // namespace

Result<> convert_capture(const SetSource& source, std::int64_t sets, const fs::path& out,
                         const Provenance& provenance, const RecordingProgress& progress,
                         std::stop_token stop) {
  fs::path folder = out;
  folder += ".parts";
  std::error_code problem;
  fs::create_directories(folder, problem);
  if (problem) {
    return unavailable(concat("cannot make '", folder.string(), "'"), problem.message(),
                       "choose another place");
  }
  std::vector<fs::path> parts;
  for (std::int64_t first = 0; first < sets; first += kBlock_sets) {
    parts.push_back(part_path(folder, first / kBlock_sets));
    const std::int64_t end = std::min(sets, first + kBlock_sets);
    if (!fs::exists(parts.back())) {  // a part appears complete or not at all
      std::vector<FrameSet> block;
      for (std::int64_t index = first; index < end; ++index) {
        if (stop.stop_requested()) {
          return unavailable("stopped", "on request", "run it again: what is done is kept");
        }
        auto set = source(index);
        if (!set) return tl::unexpected(set.error());
        block.push_back(std::move(*set));
      }
      if (auto ok = write_frames(parts.back(), block, provenance); !ok) return ok;
    }
    progress(end, sets);
  }
  if (auto ok = merge_frame_files(parts, out, provenance); !ok) return ok;
  fs::remove_all(folder, problem);
  return {};
}

}  // namespace flamefield
