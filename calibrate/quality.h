#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "proto/rig.h"

namespace flamefield {

// An upright cylinder in which the flame burns.
struct MeasuringVolume {
  Eigen::Vector3d centre_mm{0, 40, 0};
  double diameter_mm = 60;
  double height_mm = 80;
};

// Points on the axis and on two rings (half and full radius) at five heights.
std::vector<Eigen::Vector3d> points_of(const MeasuringVolume& volume);

struct VolumeError {
  double mean_px = 0;   // mean over the cameras of each one's RMS
  double worst_px = 0;  // the worst camera's RMS
  std::string worst_camera;
};

enum class Alignment {
  None,   // the world frame is part of the result
  Rigid,  // the estimated world is first moved onto the true one
};

// Where the estimated rig projects the measuring volume, against where the true one does. Millimetres would
// mislead: depth and focal length trade off without moving a pixel. InvalidInput when a camera is missing.
Result<VolumeError> volume_error_px(const Rig& estimated, const Rig& truth, const MeasuringVolume& volume,
                                    Alignment alignment = Alignment::None);

// estimated_from_true world: the rigid motion that makes those shifts smallest. Both rigs hold the same
// cameras in the same order, at least one.
Rigid3 rigid_alignment(const Rig& estimated, const Rig& truth, const MeasuringVolume& volume);

// A shift of 0.5 px per view raises the error of a 1.6 mm flame front by 30 %, 1 px by 80 %.
enum class Verdict { Green, Amber, Red };
Verdict verdict_of(const VolumeError& error);  // by the worst camera: <= 0.2 px, <= 0.5 px, above
std::string_view name_of(Verdict verdict);

}  // namespace flamefield
