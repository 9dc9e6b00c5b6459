#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "proto/volume.h"
#include "services/store/provenance.h"

namespace flamefield {

// A field with what is known about it.
struct VolumeRecord {
  Volume volume;             // in a .vtkhdf: /VTKHDF/PointData/emission (NZ, NY, NX)
  std::vector<float> sigma;  // one standard deviation a voxel, or empty
  Provenance provenance;
};

// By extension: .vtkhdf .vti .npy .tif .tiff. A .npy (and a .tif that is not ours) holds no coordinates: its
// grid gets `spacing_mm` (1 mm when not given) and is centred on the world origin. A spacing given for a
// file that knows its own is InvalidInput when the two differ.
Result<Volume> read_volume(const std::filesystem::path& path, std::optional<double> spacing_mm = {});
Result<VolumeRecord> read_volume_record(const std::filesystem::path& path,
                                        std::optional<double> spacing_mm = {});

// .npy keeps only the values; .tif and .vti also the grid; .vtkhdf all of it.
Result<> write_volume(const std::filesystem::path& path, const Volume& volume, const Provenance& provenance,
                      std::span<const float> sigma = {});

// Whether `path` has an extension that write_volume knows; InvalidInput names those that it does.
Result<> check_volume_name(const std::filesystem::path& path);

}  // namespace flamefield
