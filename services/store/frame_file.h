#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
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

// The same one set at a time, for recordings that do not fit into memory.
class FrameReader {
 public:
  static Result<FrameReader> open(const std::filesystem::path& path);
  FrameReader(FrameReader&&) noexcept;
  ~FrameReader();

  std::size_t sets() const;
  Result<FrameSet> read(std::size_t index) const;  // contract: index < sets()

 private:
  struct Impl;
  explicit FrameReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Several files made by write_frames, one after the other, as one.
Result<> merge_frame_files(const std::vector<std::filesystem::path>& parts, const std::filesystem::path& path,
                           const Provenance& provenance);

// FOLDER/CAMERA/CAPTURE-INDEX.tif, one picture a file, grey levels as they were taken; and FOLDER/sets.csv:
// capture, index, pulse, time, and of each camera what became of it.
Result<> write_frame_tiffs(const std::filesystem::path& folder, const FrameReader& recording);

}  // namespace flamefield
