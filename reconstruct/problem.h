#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "reconstruct/monitor.h"
#include "reconstruct/noise_model.h"
#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"
#include "reconstruct/solver.h"

namespace flamefield {

// What a solver gets: find x with A x = b. The images are scaled so that the brightest pixel is 1. Arrays are
// packed like the projector's (layout.h). What follows the team is the same for all solvers and read from
// shared recipe tables; its defaults constrain nothing but the sign.
struct Problem {
  const Projector& projector;
  std::span<const float> images;  // b
  const SolveControl& control;
  Team& team;
  std::span<const std::uint8_t> support = {};  // x is 0 where this is 0; empty: everywhere
  std::span<const float> start = {};           // a warm start in the scale of the problem; empty: none
  bool non_negative = true;
  StopRules stop = {};
  NoiseModel noise = {};  // as given by the recipe; noise_of() falls back on an estimate
  float brightness = 1;   // what an image value of 1 was before, field unit x mm
};

struct Solution {
  std::vector<float> volume;  // x, packed, in the scale of the problem
  std::vector<float> sigma;   // likewise, one standard deviation of each voxel under the noise; or empty
  int iterations = 0;
  double voxel_updates = 0;
  double offspring = 0;  // evolutionary solvers only
  StopReason stop_reason = StopReason::Iterations;
  std::vector<HistoryPoint> history;
  std::vector<float> images;       // of the volume by the solver's own model, packed; empty: A x
  std::vector<Camera> cameras;     // as corrected, calibration-free mode only
  std::vector<std::string> notes;  // what the solver chose by itself, e.g. a weight
};

// Onto the constraints: x <- 0 outside the support, and max(x, 0) where negative values are not allowed.
void constrain(const Problem& problem, std::span<float> x);

// The warm start within the constraints, or zero.
std::vector<float> start_of(const Problem& problem);

// The recipe's noise model, or the estimate when it gives none.
NoiseModel noise_of(const Problem& problem);

// |a - b| / |b|; 0 when b is zero and a too. Summed in a fixed order.
double relative_distance(std::span<const float> a, std::span<const float> b);

}  // namespace flamefield
