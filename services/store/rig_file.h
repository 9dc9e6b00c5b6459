#pragma once

#include <filesystem>
#include <string>

#include "proto/rig.h"

namespace flamefield {

// rig.yaml, OpenCV FileStorage (cv2.FileStorage reads it): format, camera_count, cameras[] with name,
// image_width, image_height, camera_matrix 3x3, distortion_coefficients 1x5 (k1 k2 p1 p2 k3; may be absent),
// camera_from_world 3x4 [R|t] in mm; quality may be absent. InvalidInput names the file, the camera and the
// field. A file that we wrote and that was cut short is noticed.
Result<Rig> read_rig(const std::filesystem::path& path);
Result<> write_rig(const std::filesystem::path& path, const Rig& rig);

}  // namespace flamefield
