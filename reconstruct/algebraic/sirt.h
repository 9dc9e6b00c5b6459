#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// SIRT (Gilbert, J. Theor. Biol. 36, 1972), scaled by row and column sums R and C (Gregor and Benson, IEEE
// Trans. Med. Imaging 27, 2008):  x <- P( x + relaxation C^-1 A^T R^-1 (b - A x) ),  P: non-negative.
// With subsets of views it is the ordered-subset SART (Andersen and Kak, Ultrasonic Imaging 6, 1984).
struct SirtOptions {
  int max_iterations = 100;
  double relaxation = 1.5;
  double smoothing = 0.02;
  int subsets = 1;
};
std::vector<SettingField> sirt_fields(SirtOptions& options);
std::vector<SettingField> os_sart_fields(SirtOptions& options);

Solution solve_sirt(const Problem& problem, const SirtOptions& options);

}  // namespace flamefield
