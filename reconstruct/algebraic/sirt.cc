#include "reconstruct/algebraic/sirt.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/filter.h"
#include "reconstruct/monitor.h"
#include "reconstruct/subsets.h"

namespace flamefield {

std::vector<SettingField> sirt_fields(SirtOptions& o) {
  return {{"max_iterations", "", 1, 1e6, "iterations; more sharpen the noise", &o.max_iterations},
          {"relaxation", "", 1e-6, 1.999, "step length", &o.relaxation},
          {"smoothing", "", 0, 1, "share of a 7-point filter after each iteration", &o.smoothing}};
}

std::vector<SettingField> os_sart_fields(SirtOptions& o) {
  std::vector<SettingField> fields = sirt_fields(o);
  fields.push_back({"subsets", "", 1, 1000, "groups of views, each an update", &o.subsets});
  return fields;
}

namespace {

constexpr std::size_t kGrain = 8192;

void invert(std::vector<float>& sums) {
  for (float& s : sums) s = s > 1e-6f ? 1 / s : 0;
}

// (b - Ax) / row sum; squares of residuals are summed on the way.
double weighted_residuals(const Problem& problem, std::span<const std::size_t> views,
                          std::span<const float> inverse_rows, std::span<float> images) {
  const std::size_t pixels = problem.projector.layout().pixels_per_view();
  std::vector<double> squares(views.size(), 0);
  problem.team.run(views.size(), [&](std::size_t i) {
    for (std::size_t p = views[i] * pixels; p < (views[i] + 1) * pixels; ++p) {
      const float d = problem.images[p] - images[p];
      squares[i] += static_cast<double>(d) * d;
      images[p] = d * inverse_rows[p];
    }
  });
  double sum = 0;
  for (double s : squares) sum += s;
  return sum;
}

}  // namespace

Solution solve_sirt(const Problem& problem, const SirtOptions& options) {
  const Projector& projector = problem.projector;
  const std::size_t voxels = projector.layout().voxels();
  const auto subsets = ordered_subsets(projector.views(), options.subsets);

  std::vector<float> images(projector.layout().pixels(), 1), update(voxels, 1),
      inverse_rows(projector.layout().pixels());
  std::vector<std::vector<float>> inverse_columns(subsets.size(), std::vector<float>(voxels));
  projector.forward(problem.team, update, inverse_rows);
  invert(inverse_rows);
  for (std::size_t s = 0; s < subsets.size(); ++s) {
    projector.adjoint(problem.team, subsets[s], images, inverse_columns[s]);
    invert(inverse_columns[s]);
  }
  double norm = 0;
  for (float b : problem.images) norm += static_cast<double>(b) * b;

  Monitor monitor(problem.control, options.max_iterations, problem.stop);
  Solution out;
  out.volume = start_of(problem);
  const auto relaxation = static_cast<float>(options.relaxation);
  for (int iteration = 1;; ++iteration) {
    double squares = 0;
    for (std::size_t s = 0; s < subsets.size(); ++s) {
      projector.forward(problem.team, subsets[s], out.volume, images);
      squares += weighted_residuals(problem, subsets[s], inverse_rows, images);
      projector.adjoint(problem.team, subsets[s], images, update);
      problem.team.run_ranges(voxels, kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t j = begin; j < end; ++j)
          out.volume[j] += relaxation * inverse_columns[s][j] * update[j];
      });
      constrain(problem, out.volume);
    }
    if (options.smoothing > 0) {
      smooth(out.volume, update, projector.layout(), options.smoothing, problem.team);
      constrain(problem, out.volume);
    }
    out.iterations = iteration;
    out.voxel_updates += static_cast<double>(voxels) * static_cast<double>(subsets.size());
    if (const auto reason = monitor.after(iteration, norm > 0 ? std::sqrt(squares / norm) : 0)) {
      out.stop_reason = *reason;
      break;
    }
  }
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
