#pragma once

#include <map>
#include <string>
#include <vector>

#include "acquire/camera_array.h"
#include "proto/capture.h"

namespace flamefield {

// What the array has counted by now, as a receipt without the statistics of the streams.
std::vector<CameraReceipt> receipts_of(const CaptureProgress& progress,
                                       const std::vector<std::string>& names);

// What the cameras are set to, by the names of lab.toml where it has one.
std::map<std::string, std::string> settings_text(const CameraSettings& settings);

// What became of every frame of a capture: frames and losses as its sets say, and of what came besides, the
// difference between two receipts. `before` is empty when the capture began with the array.
std::vector<CameraAccount> accounts_of(const CaptureState& state, const std::vector<CameraReceipt>& now,
                                       const std::vector<CameraReceipt>& before);

}  // namespace flamefield
