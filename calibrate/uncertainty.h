#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "calibrate/bundle.h"

namespace flamefield {

// What the solution says about one camera.
struct CameraSigma {
  double focal_px = 0;
  double position_mm = 0;        // root of the trace of the 3x3 covariance
  double rotation_rad = 0;       // the same
  double volume_px = 0;          // expected RMS error of the projections of the given points
  std::vector<double> point_px;  // the same of each point
};

struct Uncertainty {
  std::vector<CameraSigma> cameras;  // relative to the fixed board pose
  Eigen::Vector2d bow_sigma_mm{0, 0};
  // Corners of one view are not independent: the detector errs alike on them, a board moves, a lens is not
  // quite the model's. By what factor the sigmas above exceed those of independent corners; >= 1.
  double clustering = 1;
};

// Covariance from the normal matrix and the noise of a corner coordinate, times what the scatter of whole
// views shows beyond it. The latter is the sandwich estimator over views, with the bias reduction CR2 (Bell
// and McCaffrey, "Bias reduction in standard errors for linear regression with multi-stage samples", 2002).
// None when the normal matrix is singular.
std::optional<Uncertainty> uncertainty(const Bundle& bundle, const BundleOptions& options, double sigma_px,
                                       std::span<const Eigen::Vector3d> volume_mm);

}  // namespace flamefield
