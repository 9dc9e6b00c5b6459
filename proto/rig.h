#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/camera.h"
#include "proto/error.h"

namespace flamefield {

// How well one camera is known, as its calibration session found it.
struct CameraQuality {
  int images = 0;            // board poses in which this camera saw the board
  int corners = 0;           // corners used
  int rejected_corners = 0;  // corners left out as outliers
  double rms_px = 0;         // per point: sqrt(sum |residual|^2 / corners)
  double focal_sigma_px = 0;
  double position_sigma_mm = 0;
  double rotation_sigma_rad = 0;
};

struct RigQuality {
  double rms_px = 0;  // over all cameras, per point
  int board_poses = 0;
  std::vector<CameraQuality> cameras;  // in the order of Rig::cameras
};

// The ring of cameras around the burner, all in one world frame (mm, +y up, origin at the burner exit).
struct Rig {
  std::vector<Camera> cameras;
  std::optional<RigQuality> quality;

  // Index of a camera by name; none when the rig has no such camera.
  std::optional<std::size_t> find(std::string_view camera_name) const;
};

// Every camera valid, names present and unique, at least one camera.
Result<> validate(const Rig& rig);

// A short hexadecimal name of the rig's geometry: equal for equal cameras, whatever the quality says.
std::string fingerprint(const Rig& rig);

}  // namespace flamefield
