#pragma once

#include <filesystem>

#include "proto/rig.h"

namespace flamefield {

// COLMAP's text model: cameras.txt, images.txt, points3D.txt (empty) in `folder`, which is made if need be.
// Lengths stay mm; the principal point moves by half a pixel, as COLMAP's pixel corners are at (0, 0).
Result<> export_colmap(const std::filesystem::path& folder, const Rig& rig);

// Kalibr's camera chain (pinhole-radtan; lengths in m). InvalidInput when a lens needs k3.
Result<> export_kalibr(const std::filesystem::path& path, const Rig& rig);
// The way back. Kalibr knows no world: the first camera's frame takes its place. InvalidInput names the key.
Result<Rig> read_kalibr(const std::filesystem::path& path);

// mrcal's .cameramodel, one file a camera: out.cameramodel becomes out-CAMERA.cameramodel (lengths in m).
Result<> export_mrcal(const std::filesystem::path& path, const Rig& rig);

}  // namespace flamefield
