#pragma once

#include <span>
#include <vector>

#include "reconstruct/parallel.h"
#include "reconstruct/projector.h"
#include "reconstruct/solver.h"

namespace flamefield {

// What a solver gets: find x with A x = b. The images are scaled so that the brightest pixel is 1.
struct Problem {
  const Projector& projector;
  std::span<const float> images;  // b, packed like the projector's
  const SolveControl& control;
  Team& team;
};

struct Solution {
  std::vector<float> volume;  // x, packed, in the scale of the problem
  int iterations = 0;
  double voxel_updates = 0;
  StopReason stop_reason = StopReason::Iterations;
  std::vector<HistoryPoint> history;
};

// |a - b| / |b|; 0 when b is zero and a too. Summed in a fixed order.
double relative_distance(std::span<const float> a, std::span<const float> b);

}  // namespace flamefield
