#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"
#include "reconstruct/sweeps.h"

namespace flamefield {

// Multiplicative ART (Gordon, Bender and Herman, J. Theor. Biol. 29, 1970), all rays of a subset at once
// (block form; Byrne, IEEE Trans. Image Process. 5, 1996):
//   x_j <- x_j exp( relaxation (A_s^T log(b_s / (A_s x)))_j / (A_s^T 1)_j )
// Where images agree it finds the field of maximum entropy. Dark and negative pixels count as `floor`.
struct MartOptions {
  SweepOptions sweeps = {.max_iterations = 20, .subsets = 5, .smoothing = 0.3};
  double relaxation = 1;
  double floor = 0.001;  // least value of a pixel, share of the brightest
};
std::vector<SettingField> mart_fields(MartOptions& options);

Solution solve_mart(const Problem& problem, const MartOptions& options);

}  // namespace flamefield
