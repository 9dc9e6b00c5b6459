#include "reconstruct/evolutionary/ert.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/evolutionary/fitness.h"
#include "reconstruct/evolutionary/population.h"
#include "reconstruct/monitor.h"
#include "reconstruct/statistical/mlem.h"

namespace flamefield {

std::vector<SettingField> ert_fields(ErtOptions& o) {
  return {
      {"population_size", "", 2, 10000, "chromosomes", &o.population_size},
      {"max_generations", "", 1, 2e9, "generations", &o.max_generations},
      {"fit_threshold", "", 0, 1, "stop when 1 - Z reaches it", &o.fit_threshold},
      {"lp", "", 0.05, 16, "p of the distance L_p (Eq. 2)", &o.lp},
      {"mutation_rate", "", 0, 1, "probability of mutation", &o.mutation_rate},
      {"mutation_intensity", "voxels", 0, 1e9, "voxels a mutation changes", &o.mutation_intensity},
      {"sigma", "", 0, 100, "standard deviation of a mutation in the end; 1 is the largest voxel", &o.sigma},
      {"sigma_start", "", 0, 100, "the same in the beginning", &o.sigma_start},
      {"sigma_generations", "", 1, 1e12, "generations in which the excess of sigma falls to 1/e",
       &o.sigma_generations},
      {"annihilation_rate", "", 0, 1, "probability of annihilation", &o.annihilation_rate},
      {"annihilation_intensity", "voxels", 0, 1e9, "voxels set to zero", &o.annihilation_intensity},
      {"filter_rate", "", 0, 1, "probability of the local filter", &o.filter_rate},
      {"filter_intensity", "voxels", 0, 1e9, "voxels filtered", &o.filter_intensity},
      {"weak_elitism", "", 0, 1, "the best is always one parent", &o.weak_elitism},
      {"strong_elitism", "", 0, 1, "the best survives unaltered", &o.strong_elitism},
      {"mask_samples", "", 1, 1e9, "voxels in the stochastic mask", &o.mask_samples},
      {"ma_start", "", 0, 2e9, "generation from which the mask follows the best", &o.ma_start},
      {"steps", "", 1, 2e9, "generations between new masks", &o.steps},
      {"render_every", "", 1, 2e9, "generations between full renderings", &o.render_every},
      {"columns_budget_mib", "MiB", 0, 1e9, "columns of A that need more are worked out at every use",
       &o.columns_budget_mib},
      {"incremental", "", 0, 1, "derive images from the parents'; false renders all, slowly",
       &o.incremental}};
}

namespace {

// What a voxel value of 1 stands for: chromosomes live in [0, 1], so it must be above the brightest voxel. A
// few iterations of OSEM tell its order of magnitude; thin fronts come out too dim by then.
float largest_voxel(const Problem& problem) {
  const SolveControl quiet{.threads = problem.control.threads, .stop = problem.control.stop};
  const Solution rough = solve_mlem({problem.projector, problem.images, quiet, problem.team},
                                    {.max_iterations = 6, .subsets = 5, .smoothing = 0.1});
  return 1.25f * *std::ranges::max_element(rough.volume);
}

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
Solution solve_ert(const Problem& problem, const ErtOptions& options) {
  Monitor monitor(problem.control, options.max_generations);
  Solution out;
  const Layout& layout = problem.projector.layout();
  out.volume.assign(layout.voxels(), 0);
  const float scale = largest_voxel(problem);
  if (!(scale > 0)) {
    out.stop_reason = StopReason::Fitness;
    return out;
  }
  const std::uint64_t seed = problem.control.seed;
  const auto samples = static_cast<std::size_t>(options.mask_samples);
  Stream mask_stream(seed, std::uint64_t{kMaskStream} << 56);
  Population population(problem, options, scale);
  Mask mask = within_support(
      problem, mask_from_images(problem.projector, population.measured(), samples, mask_stream));
  if (mask.empty()) return out;

  constexpr int kReportEvery = 500;
  bool use_gradient = false;
  for (int generation = 1;; ++generation) {
    const double sigma = options.sigma + (options.sigma_start - options.sigma) *
                                             std::exp(-generation / options.sigma_generations);
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
  out.voxel_updates = population.voxel_updates();
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
