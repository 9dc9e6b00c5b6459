#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// ART (Kaczmarz, Bull. Int. Acad. Polon. Sci. A 35, 1937; Gordon, Bender and Herman, J. Theor. Biol. 29,
// 1970): one ray after the other,  x <- P( x + relaxation (b_i - a_i x) / |a_i|^2 a_i ),  P: the constraints.
// Rays follow each other in golden-section steps over the views and over the pixels of a view, so that
// neighbours in time have little in common (Guan and Gordon, Phys. Med. Biol. 39, 1994). What one ray does
// depends on the ray before: it runs on one thread.
struct ArtOptions {
  int max_iterations = 10;  // sweeps over all rays
  double relaxation = 0.3;
  double smoothing = 0.2;           // share of the paper's filter after each sweep
  double memory_budget_mib = 4096;  // for the rows of A
};
std::vector<SettingField> art_fields(ArtOptions& options);

// InvalidInput: the rows need more than the budget.
Result<Solution> solve_art(const Problem& problem, const ArtOptions& options);

// The order in which ART takes the pixels of (views, rows, cols).
std::vector<std::uint32_t> ray_order(std::size_t views, std::size_t pixels_per_view);

}  // namespace flamefield
