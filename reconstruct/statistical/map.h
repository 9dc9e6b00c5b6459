#pragma once

#include <vector>

#include "reconstruct/algebraic/quadratic.h"

namespace flamefield {

// Maximum a posteriori for Gaussian noise of known variance and a Gaussian prior of smoothness (Tarantola,
// Inverse Problem Theory, 2005, ch. 3): pixels count by the inverse of their variance.
//
// Solution::sigma is how much the noise of the images scatters each voxel: the standard deviation of the
// fields that come out when noise is drawn anew around the images of the solution (parametric bootstrap;
// Efron and Tibshirani, 1993, ch. 6). Unlike a closed formula this holds with positivity. The bias of the
// prior is not in it.
struct MapOptions {
  QuadraticOptions quadratic;
  int draws = 32;  // of the noise; 0: no sigma. Their number n leaves sigma uncertain by 1 / sqrt(2 n)
};
std::vector<SettingField> map_fields(MapOptions& options);

Solution solve_map(const Problem& problem, const MapOptions& options);

}  // namespace flamefield
