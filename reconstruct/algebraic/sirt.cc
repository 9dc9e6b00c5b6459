#include "reconstruct/algebraic/sirt.h"

#include <algorithm>

#include "reconstruct/vectors.h"

namespace flamefield {

namespace {

std::vector<SettingField> with_relaxation(SirtOptions& o, Subsets subsets) {
  std::vector<SettingField> fields = fields_of(o.sweeps, subsets);
  fields.push_back({"relaxation", "", 1e-6, 1.999, "step length", &o.relaxation});
  return fields;
}

}  // namespace

std::vector<SettingField> sirt_fields(SirtOptions& o) {
  return with_relaxation(o, Subsets::Fixed);
}
std::vector<SettingField> os_sart_fields(SirtOptions& o) {
  return with_relaxation(o, Subsets::Chosen);
}

Solution solve_sirt(const Problem& problem, const SirtOptions& options) {
  const Layout& layout = problem.projector.layout();
  std::vector<float> row_sums(layout.pixels());
  problem.projector.forward(problem.team, even_volume(layout), row_sums);
  const float least_row = kLeastShare * *std::ranges::max_element(row_sums);
  std::vector<float> column_sums(layout.voxels());
  problem.projector.adjoint(problem.team, even_images(layout), column_sums);
  const auto largest = static_cast<float>(
      problem.projector.share().largest(static_cast<double>(*std::ranges::max_element(column_sums))));
  const float most = largest / static_cast<float>(options.sweeps.subsets);
  const float least_column = std::max(kUnmet, kLeastShare * most);
  const auto relaxation = static_cast<float>(options.relaxation);

  SweepSteps steps;
  steps.compare = [&](std::size_t begin, std::size_t end, std::span<float> images) {
    double squares = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const float d = problem.images[p] - images[p];
      squares += static_cast<double>(d) * d;
      images[p] = row_sums[p] > kUnmet ? d / std::max(row_sums[p], least_row) : 0;
    }
    return squares;
  };
  steps.correct = [&](std::size_t begin, std::size_t end, std::span<const float> back,
                      std::span<const float> sums, std::span<float> x) {
    for (std::size_t j = begin; j < end; ++j) x[j] += relaxation * back[j] / std::max(sums[j], least_column);
  };
  return sweep(problem, options.sweeps, start_of(problem), steps);
}

Solution solve_sart(const Problem& problem, const SirtOptions& options) {
  SirtOptions one_view = options;
  one_view.sweeps.subsets = static_cast<int>(problem.projector.views());
  return solve_sirt(problem, one_view);
}

}  // namespace flamefield
