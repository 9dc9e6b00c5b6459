#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "calibrate/bundle.h"
#include "calibrate/calibrate.h"
#include "calibrate/sightings.h"

namespace flamefield {

// Intrinsics to begin with, one for each camera of a session; none for a camera that never saw the board.
struct Starts {
  std::vector<std::optional<Camera>> cameras;
  std::vector<bool> focal_known;
};

// From what is known of a camera, else from its own views, else with the focal length of the others.
Result<Starts> start_cameras(const Sightings& sightings, const BoardSpec& board,
                             const CalibrationOptions& options);

inline constexpr std::size_t kNotSolved = static_cast<std::size_t>(-1);

// The connected part of a session, numbered without gaps, and the way back to the session's numbers.
struct Connected {
  Bundle bundle;
  std::vector<std::size_t> session_camera, session_pose;  // of each camera and pose of the bundle
  std::vector<std::size_t> bundle_view;                   // of each sighting, or kNotSolved
};

// Poses of single views, chained to the reference; what hangs together becomes the bundle.
Connected connect(const Sightings& sightings, const Starts& starts, const BoardSpec& board,
                  const CalibrationOptions& options);

}  // namespace flamefield
