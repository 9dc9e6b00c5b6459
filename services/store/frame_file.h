#pragma once

#include <filesystem>
#include <vector>

#include "proto/frame.h"
#include "services/store/provenance.h"

namespace flamefield {

// Recorded frame sets of any captures (dark, background, burst, ...) in one NXtomo-style .nxs:
//   /entry/sets/{capture,kind,image_key,pulse,index,pulse_time_ns,complete_time_ns}   one row a set
//   /entry/instrument/CAMERA/data (frames, rows, cols) uint8 or uint16, gzip; attribute pixel_format
//   /entry/instrument/CAMERA/{pulse,device_time_ns,arrival_time_ns,exposure_us}       one row a frame
//   /entry/instrument/CAMERA/status   one text a set: "stored", "absent" or the cause of the loss
// Packed 12-bit pixels are stored unpacked. InvalidInput when a camera's frames differ in size or format.
Result<> write_frames(const std::filesystem::path& path, const std::vector<FrameSet>& sets,
                      const Provenance& provenance);

// The sets as they were, each with its frames and losses in the order of the cameras' names.
Result<std::vector<FrameSet>> read_frames(const std::filesystem::path& path);

}  // namespace flamefield
