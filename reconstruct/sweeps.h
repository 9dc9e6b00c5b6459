#pragma once

#include <functional>
#include <span>
#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// What the solvers share that go round the views again and again: forward, compare with the images, back
// project, correct the field.
struct SweepOptions {
  int max_iterations = 100;  // sweeps over all views
  int subsets = 1;           // groups of views, each of which corrects the field once a sweep
  double smoothing = 0;      // share of the paper's filter (1/2 centre + 1/12 neighbours) after each sweep
};
enum class Subsets { Fixed, Chosen };  // whether the number of subsets is a setting
std::vector<SettingField> fields_of(SweepOptions& options, Subsets subsets);

// mm; a column or ray whose sum is not longer tells nothing.
inline constexpr float kUnmet = 1e-6f;

// Rays and voxels that are only grazed have small sums, and noise divided by them is a bright speck: no
// divisor is smaller than this share of the largest. A shorter step does not move the solution.
inline constexpr float kLeastShare = 0.02f;

struct SweepSteps {
  // Pixels [begin, end): turns Ax in `images` into what is back-projected; returns the sum of (b - Ax)^2.
  std::function<double(std::size_t begin, std::size_t end, std::span<float> images)> compare;
  // Voxels [begin, end): corrects x by what was back-projected. `sums` are the column sums A_s^T 1.
  std::function<void(std::size_t begin, std::size_t end, std::span<const float> back,
                     std::span<const float> sums, std::span<float> x)>
      correct;
};

// Sweeps from `start` until a rule ends it. Voxels that no ray meets are zero.
Solution sweep(const Problem& problem, const SweepOptions& options, std::vector<float> start,
               const SweepSteps& steps);

// An even field of about the right total, or the warm start lifted from exact zero: for solvers that
// multiply.
std::vector<float> positive_start(const Problem& problem);

// Views dealt out to subsets like cards, so that each looks from all around; subsets follow each other in an
// order in which neighbours differ most (Herman and Meyer, 1993: bit reversal; here golden-section steps).
std::vector<std::vector<std::size_t>> ordered_subsets(std::size_t views, int wanted);

}  // namespace flamefield
