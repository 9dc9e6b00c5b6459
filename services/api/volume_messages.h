#pragma once

#include <string>

#include "proto/volume.h"
#include "services/ledger/reader.h"

namespace flamefield {

struct VolumeForm {
  int most_side = 96;  // voxels: averaged over whole blocks to fit
  int bits = 8;  // 8 or 16: uint8 or uint16 (little-endian); value = low + (high - low) * stored / full scale
};

// A run's volume as a binary message. Header: topic "volume", run, capture, index, inputs, solver, size[3],
// spacing_mm[3], origin_mm[3], full_size[3], low, high, bits, pulse_time_ns, committed_time_ns. The payload
// is (nz, ny, nx) with x fastest. InvalidInput: the volume holds NaN or infinity, which no picture may hide.
Result<std::string> volume_message(const Volume& volume, const RunRow& run, std::int64_t pulse_time_ns,
                                   const VolumeForm& form);

// Brightest value along z, as a small PNG with inferno: what a row of the table of runs shows.
Result<std::string> thumbnail_png(const Volume& volume);

}  // namespace flamefield
