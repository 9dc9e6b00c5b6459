#pragma once

#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// "map.beta=1,2" and "map.iterations=5,6" -> four lists of assignments, "map.beta=1", "map.iterations=5" ...
// One empty list when there is no sweep. InvalidInput: no '=', no value, or more than 10 000 combinations.
Result<std::vector<std::vector<std::string>>> sweep_combinations(const std::vector<std::string>& sweeps);

}  // namespace flamefield
