#include "reconstruct/statistical/mlem.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/filter.h"
#include "reconstruct/monitor.h"
#include "reconstruct/subsets.h"

namespace flamefield {

std::vector<SettingField> mlem_fields(MlemOptions& o) {
  return {{"max_iterations", "", 1, 1e6, "iterations; more sharpen the noise", &o.max_iterations},
          {"smoothing", "", 0, 1, "share of a 7-point filter after each iteration", &o.smoothing}};
}

std::vector<SettingField> osem_fields(MlemOptions& o) {
  std::vector<SettingField> fields = mlem_fields(o);
  fields.push_back({"subsets", "", 1, 1000, "groups of views, each an update", &o.subsets});
  return fields;
}

namespace {

constexpr std::size_t kGrain = 8192;

// b / Ax, where the ray can see anything; squares of residuals are summed on the way.
double ratios(const Problem& problem, std::span<const std::size_t> views, std::span<float> images) {
  const std::size_t pixels = problem.projector.layout().pixels_per_view();
  std::vector<double> squares(views.size(), 0);
  problem.team.run(views.size(), [&](std::size_t i) {
    for (std::size_t p = views[i] * pixels; p < (views[i] + 1) * pixels; ++p) {
      const float b = std::max(problem.images[p], 0.0f), ax = images[p];
      squares[i] += static_cast<double>(b - ax) * (b - ax);
      images[p] = ax > 1e-9f ? b / ax : 0;
    }
  });
  double sum = 0;
  for (double s : squares) sum += s;
  return sum;
}

}  // namespace

Solution solve_mlem(const Problem& problem, const MlemOptions& options) {
  const Projector& projector = problem.projector;
  const std::size_t voxels = projector.layout().voxels();
  const auto subsets = ordered_subsets(projector.views(), options.subsets);

  std::vector<float> images(projector.layout().pixels(), 1), update(voxels);
  std::vector<std::vector<float>> sensitivity(subsets.size(), std::vector<float>(voxels));
  for (std::size_t s = 0; s < subsets.size(); ++s)
    projector.adjoint(problem.team, subsets[s], images, sensitivity[s]);
  double norm = 0;
  for (float b : problem.images) norm += static_cast<double>(b) * b;

  Monitor monitor(problem.control, options.max_iterations, problem.stop);
  Solution out;
  // Starts where the total is about right, or warm; a voxel of exactly zero would never light up again.
  constexpr float kFaint = 1e-4f;
  std::vector<float> seen(voxels, 1);
  projector.forward(problem.team, seen, images);
  double sum_b = 0, sum_a = 0;
  for (std::size_t p = 0; p < images.size(); ++p) {
    sum_b += std::max(problem.images[p], 0.0f);
    sum_a += images[p];
  }
  const float level = sum_a > 0 ? static_cast<float>(sum_b / sum_a) : 0.0f;
  out.volume = start_of(problem);
  for (float& x : out.volume) x = problem.start.empty() ? level : std::max(x, kFaint * level);
  constrain(problem, out.volume);

  for (int iteration = 1;; ++iteration) {
    double squares = 0;
    for (std::size_t s = 0; s < subsets.size(); ++s) {
      projector.forward(problem.team, subsets[s], out.volume, images);
      squares += ratios(problem, subsets[s], images);
      projector.adjoint(problem.team, subsets[s], images, update);
      problem.team.run_ranges(voxels, kGrain, [&](std::size_t begin, std::size_t end) {
        for (std::size_t j = begin; j < end; ++j) {
          const float a = sensitivity[s][j];
          if (a > 1e-6f) out.volume[j] *= update[j] / a;
        }
      });
    }
    if (options.smoothing > 0) {
      smooth(out.volume, update, projector.layout(), options.smoothing, problem.team);
      constrain(problem, out.volume);
    }
    out.iterations = iteration;
    out.voxel_updates += static_cast<double>(voxels) * static_cast<double>(subsets.size());
    const double residual = norm > 0 ? std::sqrt(squares / norm) : 0;
    if (const auto reason = monitor.after(iteration, residual)) {
      out.stop_reason = *reason;
      break;
    }
  }
  // A voxel that no ray of a subset met has kept its start value.
  problem.team.run_ranges(voxels, kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) {
      const bool met = std::ranges::any_of(sensitivity, [&](const auto& s) { return s[j] > 1e-6f; });
      if (!met) out.volume[j] = 0;
    }
  });
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
