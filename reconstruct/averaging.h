#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "proto/frame.h"
#include "proto/image.h"

namespace flamefield {

// Grey levels by camera name.
using CameraImages = std::map<std::string, Image>;

// What one capture comes to. Saturated: pixels, as indices into (rows, cols), that reached the full scale of
// the sensor in at least one frame; their mean is too low.
struct MeanImages {
  CameraImages images;
  std::map<std::string, std::vector<std::uint32_t>> saturated = {};
  std::size_t sets = 0;
  double full_scale = 0;  // grey level of a saturated pixel; the largest where formats differ

  bool empty() const { return images.empty(); }
};

// Mean of the frames of each camera over the sets. InvalidInput when a frame's bytes do not match its size,
// or frames of one camera differ in size.
Result<MeanImages> mean_images(const std::vector<FrameSet>& sets);

// Which sets of a burst show one phase of a flame that repeats itself.
struct PhaseLock {
  int every = 1;            // pulses between two that are taken, counted from the first one there is
  int first = 0;            // 0 .. every - 1: the first that is taken
  double frequency_hz = 0;  // of the flame; 0: take every phase
  int bins = 8;             // phases in a period
  int bin = 0;              // 0 .. bins - 1: the one that is taken; phase 0 is the first pulse

  bool is_on() const { return every > 1 || frequency_hz > 0; }
};

// InvalidInput: first or bin out of range, sets without pulse times, or no set of this phase.
Result<std::vector<FrameSet>> phase_locked(const std::vector<FrameSet>& sets, const PhaseLock& lock);

}  // namespace flamefield
