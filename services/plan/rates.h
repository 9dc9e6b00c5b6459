#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "proto/error.h"
#include "proto/recipe.h"
#include "proto/volume.h"

namespace flamefield {

// What one reconstruction takes, as measured: of one core, and of memory.
struct Rates {
  std::string source;            // where the figures come from, in words
  double voxel_iteration_s = 0;  // CPU, a voxel and an iteration, with these many views
  double voxel_set_up_s = 0;     // likewise, once a solve
  double pixel_iteration_s = 0;  // CPU, a pixel of all images and an iteration, beside the projector
  double voxel_bytes = 0;        // of the solver's memory
  double pixel_bytes = 0;        // likewise
  double base_bytes = 0;         // of the program
};

// Runs the recipe's solver on two small flames seen by so many views, on one core: a few seconds.
// InvalidInput: a solver whose time does not follow from its iterations, as evolution's.
Result<Rates> measure_rates(const Recipe& recipe, int views, std::stop_token stop,
                            const std::function<void(const std::string&)>& progress);

// How often the recipe goes round at most; none: nobody can tell.
std::optional<int> iterations_of(const Recipe& recipe);

}  // namespace flamefield
