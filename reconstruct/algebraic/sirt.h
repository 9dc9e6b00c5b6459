#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"
#include "reconstruct/sweeps.h"

namespace flamefield {

// SIRT (Gilbert, J. Theor. Biol. 36, 1972), scaled by row and column sums R and C (Gregor and Benson, IEEE
// Trans. Med. Imaging 27, 2008):  x <- P( x + relaxation C^-1 A^T R^-1 (b - A x) ),  P: the constraints.
// One view at a time it is SART (Andersen and Kak, Ultrasonic Imaging 6, 1984), with groups of views OS-SART
// (Wang and Jiang, J. X-Ray Sci. Technol. 12, 2004).
struct SirtOptions {
  SweepOptions sweeps = {.max_iterations = 150, .smoothing = 0.05};
  double relaxation = 1.5;
};
std::vector<SettingField> sirt_fields(SirtOptions& options);  // of SIRT and SART
std::vector<SettingField> os_sart_fields(SirtOptions& options);

Solution solve_sirt(const Problem& problem, const SirtOptions& options);
Solution solve_sart(const Problem& problem, const SirtOptions& options);  // every view is a subset

}  // namespace flamefield
