#pragma once

#include <cmath>

#include "reconstruct/variational/primal_dual.h"

namespace flamefield {

// Finds the priors' weights while the primal-dual iteration runs.
//
// Size: a weight is right when what the field leaves unexplained is noise. Noise from pixel to pixel is
// white, so the residual must then be as large as its own finest detail says (residual_size); a field that is
// too smooth leaves structure behind, whose residual is larger than that. No noise level needs to be known,
// and fine structure of the flame does not count as noise. To this comes a floor for what voxels cannot
// model. When the noise level is given, it takes the place of the fine detail (Morozov's discrepancy
// principle).
//
// Kind: bodies of one brightness want the gradient's norm small, flames the Hessian's. (sum x)(sum x^3) /
// (sum x^2)^2 is 1 for a field of two values, 0 and one other, and more for all others (Cauchy and Schwarz);
// where it comes near to 1, the gradient joins in.
class WeightSearch {
 public:
  enum class Kind { Variation, Adaptive };

  // known_noise: rms over all pixels, 0 when not known
  WeightSearch(const Problem& problem, Kind kind, double known_noise);

  PriorWeights weights() const;

  // Compares the state of the iteration with the aim and changes the weights.
  void update(const Problem& problem, const PrimalDual& state);

 private:
  Kind kind_;
  double known_noise_;
  double lowest_, highest_;
  double weight_;
  double variation_share_ = 0;
  double last_rms_ = INFINITY;
};

// (sum x)(sum x^3) / (sum x^2)^2 of a non-negative field; 1 for a dark one.
double two_valuedness(const GuardedVolume& x);

}  // namespace flamefield
