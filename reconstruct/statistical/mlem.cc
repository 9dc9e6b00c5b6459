#include "reconstruct/statistical/mlem.h"

#include <algorithm>

namespace flamefield {

std::vector<SettingField> mlem_fields(SweepOptions& o) {
  return fields_of(o, Subsets::Fixed);
}
std::vector<SettingField> osem_fields(SweepOptions& o) {
  return fields_of(o, Subsets::Chosen);
}

Solution solve_mlem(const Problem& problem, const SweepOptions& options) {
  SweepSteps steps;
  steps.compare = [&](std::size_t begin, std::size_t end, std::span<float> images) {
    constexpr float kDark = 1e-9f;  // a ray that can see nothing tells nothing
    double squares = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const float b = std::max(problem.images[p], 0.0f), ax = images[p];
      squares += static_cast<double>(b - ax) * (b - ax);
      images[p] = ax > kDark ? b / ax : 0;
    }
    return squares;
  };
  steps.correct = [](std::size_t begin, std::size_t end, std::span<const float> back,
                     std::span<const float> sums, std::span<float> x) {
    for (std::size_t j = begin; j < end; ++j) x[j] *= sums[j] > kUnmet ? back[j] / sums[j] : 1;
  };
  return sweep(problem, options, positive_start(problem), steps);
}

}  // namespace flamefield
