#pragma once

#include <deque>
#include <map>
#include <string>

#include "proto/volume.h"

namespace flamefield {

// What a run takes. 0: unknown.
struct Cost {
  double wall_s = 0;
  double peak_mib = 0;
};

// What a run is like: the same setup (rig, recipe and grid), or at least the same solver.
struct RunShape {
  std::string setup;
  std::string solver;
  double work = 0;  // voxels x views
};

double work_of(const Grid& grid, std::size_t views);

// Foretells what a run will take from what others took. The same setup: the median of the last times, the
// most memory. Another setup of the same solver: the run next in size; time grows with the work, memory at
// most so.
class CostModel {
 public:
  void observe(const RunShape& shape, const Cost& cost);
  Cost estimate(const RunShape& shape) const;

 private:
  std::map<std::string, std::deque<Cost>> by_setup_;                // the newest few
  std::map<std::string, std::map<double, std::string>> by_solver_;  // work -> setup
};

}  // namespace flamefield
