#include "reconstruct/evolutionary/generational.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/evolutionary/fitness.h"
#include "reconstruct/evolutionary/population.h"
#include "reconstruct/monitor.h"

namespace flamefield {

namespace {

// The mask without voxels outside the support; none left means that nothing may be lit.
Mask within_support(const Problem& problem, Mask mask) {
  if (problem.support.empty()) return mask;
  const Layout& layout = problem.projector.layout();
  const auto nx = static_cast<std::uint32_t>(layout.nx), ny = static_cast<std::uint32_t>(layout.ny);
  std::erase_if(mask, [&](std::uint32_t v) {
    return !problem.support[layout.voxel(static_cast<int>(v % nx), static_cast<int>(v / nx % ny),
                                         static_cast<int>(v / nx / ny))];
  });
  return mask;
}

enum Purpose : std::uint64_t { kMaskStream = 1, kOffspringStream = 2 };

}  // namespace

// Algorithm 1.
Solution evolve_generations(const Problem& problem, const ErtOptions& options, const MeasurementModel& model,
                            float scale) {
  Monitor monitor(problem.control, options.max_generations);
  Solution out;
  const Layout& layout = problem.projector.layout();
  out.volume.assign(layout.voxels(), 0);
  const std::uint64_t seed = problem.control.seed;
  const auto samples = static_cast<std::size_t>(options.mask_samples);
  Stream mask_stream(seed, std::uint64_t{kMaskStream} << 56);
  Population population(problem, options, model, scale);
  Mask mask = within_support(
      problem, mask_from_images(problem.projector, population.measured(), samples, mask_stream));
  if (mask.empty()) return out;

  constexpr int kReportEvery = 500;
  bool use_gradient = false;
  for (int generation = 1;; ++generation) {
    const double excess = options.sigma_start > 0 ? options.sigma_start - options.sigma : 0;
    const double sigma = options.sigma + excess * std::exp(-generation / options.sigma_generations);
    population.evolve(mask, sigma, seed,
                      (std::uint64_t{kOffspringStream} << 56) | static_cast<std::uint64_t>(generation) << 16);
    if (generation % options.render_every == 0) population.render_anew();
    if (generation > options.ma_start && generation % options.steps == 0) {
      const std::vector<float> best = population.best_field();
      Mask drawn = within_support(
          problem, mask_from_field(use_gradient ? gradient_magnitude(best, problem.projector.grid()) : best,
                                   samples, mask_stream));
      if (!drawn.empty()) mask = std::move(drawn);
      use_gradient = !use_gradient;
    }
    std::optional<StopReason> reason = monitor.interrupted();
    if (generation >= options.max_generations) reason = StopReason::Iterations;
    if (1 - population.best().z >= options.fit_threshold) reason = StopReason::Fitness;
    if (reason || generation % kReportEvery == 0) {
      const double residual = relative_distance(population.best().images, population.measured());
      monitor.after(generation, residual, 1 - population.best().z);
    }
    if (reason) {
      out.stop_reason = *reason;
      out.iterations = generation;
      break;
    }
  }
  out.volume = layout.pack_volume(population.best_field());
  for (float& v : out.volume) v *= scale;
  out.offspring = static_cast<double>(out.iterations) * (options.pop_size - (options.strong_elitism ? 1 : 0));
  out.voxel_updates = population.voxel_updates();
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
