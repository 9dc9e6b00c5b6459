#pragma once

#include <limits>

#include "reconstruct/variational/primal_dual.h"

namespace flamefield {

// Finds the priors' weights while the primal-dual iteration runs.
//
// Size: Morozov's discrepancy principle. A weight is right when the field leaves as much of the images
// unexplained as there is noise in them (noise_level(), or the recipe's noise model), and a floor for what
// voxels cannot model.
//
// Kind: bodies of one brightness want the gradient's norm small, flames the Hessian's. (sum x)(sum x^3) /
// (sum x^2)^2 is 1 for a field of two values, 0 and one other, and more for all others (Cauchy and Schwarz);
// where it comes near to 1, the gradient joins in.
class WeightSearch {
 public:
  enum class Kind { Variation, Adaptive };

  WeightSearch(const Problem& problem, Kind kind);

  PriorWeights weights() const;

  // Compares the state of the iteration with the aim and changes the weights.
  void update(const PrimalDual& state);

 private:
  const Problem& problem_;
  Kind kind_;
  double pixels_, noise_, usual_, weight_;
  double variation_share_ = 0;
  double last_rms_ = std::numeric_limits<double>::infinity();
};

// (sum x)(sum x^3) / (sum x^2)^2 of a non-negative field, of which x is what is held; 1 for a dark one.
double two_valuedness(const Share& share, const Layout& layout, std::span<const float> x);

}  // namespace flamefield
