#pragma once

#include <vector>

#include "reconstruct/algebraic/quadratic.h"

namespace flamefield {

// Maximum a posteriori for Gaussian noise of known variance and a Gaussian prior of smoothness (Tarantola,
// Inverse Problem Theory, 2005, ch. 3): pixels count by the inverse of their variance.
//
// Solution::sigma is a standard deviation of each voxel, found by solving again for random draws:
// - Noise: how much the noise of the images scatters the solution; noise is drawn anew around the images of
// the
//   solution (parametric bootstrap; Efron and Tibshirani, 1993, ch. 6). The bias of the prior is not in it.
// - Posterior: how uncertain the field is, given images and prior; both are disturbed (Papandreou and Yuille,
//   NIPS 2010). Exact without positivity, and wider where the cameras see little.
// Unlike closed formulas both hold with positivity.
enum class MapSigma { Noise, Posterior };
struct MapOptions {
  QuadraticOptions quadratic;
  MapSigma sigma = MapSigma::Noise;
  int draws = 32;  // 0: no sigma. Their number n leaves sigma uncertain by 1 / sqrt(2 n)
};
std::vector<SettingField> map_fields(MapOptions& options);

Solution solve_map(const Problem& problem, const MapOptions& options);

}  // namespace flamefield
