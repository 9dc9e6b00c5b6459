#pragma once

#include <vector>

#include "reconstruct/evolutionary/camera_genes.h"
#include "reconstruct/evolutionary/ert.h"

namespace flamefield {

// Calibration-free mode (paper, Introduction): cameras evolve by turns with the field. A view's genes are
// mutated, the best field is rendered through the mutated camera, and what fits the view's image better
// stays. Fields are smooth in the first rounds, so that they do not learn the cameras' errors by heart.
Result<Solution> solve_with_cameras(const Problem& problem, const ErtOptions& options);

// The camera that fits an image (packed, one view) of the field best, by mutations of its genes alone.
Camera evolve_camera(const Camera& camera, const Volume& field, std::span<const float> image,
                     const Layout& layout, double lp, double least_step_px, Stream stream);

}  // namespace flamefield
