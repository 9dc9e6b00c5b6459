#pragma once

#include <filesystem>

#include "proto/image.h"
#include "proto/rig.h"
#include "services/store/provenance.h"

namespace flamefield {

// .nxs: /entry/data/data float32 (view, row, col) and /entry/data/view, the camera names (NeXus NXdata).
// .npy, .tif: (views, rows, cols) without names. Reading those, the views take the names of `rig`'s cameras
// in order (InvalidInput when the counts differ), or cam00, cam01, ... without a rig.
Result<Projections> read_projections(const std::filesystem::path& path, const Rig* rig = nullptr);
Result<> write_projections(const std::filesystem::path& path, const Projections& projections,
                           const Provenance& provenance);
Result<> check_projection_name(const std::filesystem::path& path);

// The rig's cameras in the order of the views; a view whose camera the rig lacks is InvalidInput that names
// it and `path`, the rig's file.
Result<Rig> rig_of_views(const Rig& rig, const Projections& projections, const std::filesystem::path& path);

}  // namespace flamefield
