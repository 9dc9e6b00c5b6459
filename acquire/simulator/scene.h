#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "proto/image.h"

namespace flamefield {

// One edge of the trigger line, the same for all cameras.
struct Pulse {
  std::int64_t number = 0;   // since the generator was made, from 1
  std::int64_t index = 0;    // in its train, from 0
  std::int64_t time_ns = 0;  // UTC, when the edge was due
  bool is_stray = false;     // noise on the line of one camera, after the pulse of this number
};

// Exposure time that a scene's light is given for.
inline constexpr double kSceneExposure_us = 350;

// What one camera (number in the array) sees at one pulse: mean photo-electrons per pixel for an exposure of
// kSceneExposure_us, (rows, cols) of the whole sensor, without noise, lens shading or sensor limits. nullptr:
// no light. Called from the cameras' own threads, several at once.
using Scene = std::function<std::shared_ptr<const Image>(std::size_t camera, const Pulse& pulse)>;

}  // namespace flamefield
