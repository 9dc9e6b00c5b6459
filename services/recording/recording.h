#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "services/bus/client.h"
#include "services/store/frame_file.h"

namespace flamefield {

using RecordingProgress = std::function<void(std::int64_t done, std::int64_t total)>;

// Set `index` of a capture, from wherever it lies.
using SetSource = std::function<Result<FrameSet>(std::int64_t index)>;

// A capture as one .nxs file, see store/frame_file.h. Works in blocks, each a file of its own beside `out`
// (OUT.parts/), which stay when this is interrupted in any way: called again, it goes on behind them. `out`
// appears when it is complete. Unavailable: stopped, or no room.
Result<> convert_capture(const SetSource& source, std::int64_t sets, const std::filesystem::path& out,
                         const Provenance& provenance, const RecordingProgress& progress,
                         std::stop_token stop);

struct ReplayOptions {
  std::string capture;     // its new name
  bool keeps_time = true;  // sets come as far apart as they were taken; else as fast as they are stored
};
struct ReplayReport {
  std::int64_t sets = 0;
  double seconds = 0;
};
// Sends a recording to the dispatcher, as the cameras would.
Result<ReplayReport> replay(const FrameReader& recording, Bus& bus, const std::string& dispatcher_endpoint,
                            const ReplayOptions& options, const RecordingProgress& progress,
                            std::stop_token stop);

}  // namespace flamefield
