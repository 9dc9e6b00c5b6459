#include "reconstruct/algebraic/mart.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

std::vector<SettingField> mart_fields(MartOptions& o) {
  std::vector<SettingField> fields = fields_of(o.sweeps, Subsets::Chosen);
  fields.push_back({"relaxation", "", 1e-6, 2, "step length", &o.relaxation});
  fields.push_back({"floor", "", 1e-9, 1, "darker pixels count as this; share of the brightest", &o.floor});
  return fields;
}

Solution solve_mart(const Problem& problem, const MartOptions& options) {
  const auto floor = static_cast<float>(options.floor), relaxation = static_cast<float>(options.relaxation);
  SweepSteps steps;
  steps.compare = [&](std::size_t begin, std::size_t end, std::span<float> images) {
    double squares = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const float b = problem.images[p], ax = images[p];
      squares += static_cast<double>(b - ax) * (b - ax);
      images[p] = std::log(std::max(b, floor) / std::max(ax, floor));
    }
    return squares;
  };
  steps.correct = [&](std::size_t begin, std::size_t end, std::span<const float> back,
                      std::span<const float> sums, std::span<float> x) {
    for (std::size_t j = begin; j < end; ++j)
      if (sums[j] > kUnmet) x[j] *= std::exp(relaxation * back[j] / sums[j]);
  };
  return sweep(problem, options.sweeps, positive_start(problem), steps);
}

}  // namespace flamefield
