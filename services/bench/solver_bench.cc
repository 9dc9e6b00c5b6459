#include "services/bench/solver_bench.h"

#include <algorithm>

#include "reconstruct/metrics.h"
#include "reconstruct/random.h"
#include "reconstruct/render.h"
#include "reconstruct/ring.h"
#include "reconstruct/solver.h"
#include "services/bench/stopwatch.h"

namespace flamefield {

namespace {

void add_gaussian(Projections& projections, double share, std::uint64_t seed) {
  const double sigma = share * *std::ranges::max_element(projections.values);
  for (std::size_t i = 0; i < projections.values.size() && sigma > 0; ++i)
    projections.values[i] += static_cast<float>(sigma * Stream(seed, i).normal());
}

// The settings of a solver that end it after so many iterations or generations; empty: it has none.
std::string count_key(const std::string& solver) {
  for (const SettingDoc& doc : settings_of(solver))
    if (doc.key == "max_iterations" || doc.key == "max_generations") return solver + "." + doc.key;
  return {};
}

}  // namespace

Result<SolverProblem> make_solver_problem(const SolverProblemOptions& o) {
  constexpr int kFiner = 3;
  const Grid grid = centred_grid(o.nx, o.ny, o.nz, 1);
  const Volume fine = make_phantom({.kind = o.kind, .seed = o.seed},
                                   centred_grid(kFiner * o.nx, kFiner * o.ny, kFiner * o.nz, 1.0 / kFiner));
  const auto rig = make_ring({.views = o.views, .spacing_rad = o.spacing_rad, .radius_mm = 300}, grid);
  if (!rig) return tl::unexpected(rig.error());
  auto projections = render(fine, *rig, {.step_voxels = 0.5, .pixel_samples = 3, .threads = o.threads});
  if (!projections) return tl::unexpected(projections.error());
  add_gaussian(*projections, o.noise, o.seed);
  Team team(o.threads);
  auto projector = Projector::make(*rig, grid, {}, team);
  if (!projector) return tl::unexpected(projector.error());
  return SolverProblem{resample(fine, grid), std::move(*projections), std::move(*projector)};
}

Result<SolverTiming> time_to_target(const SolverProblem& problem, const std::string& solver, double target,
                                    double most_s, int threads, std::stop_token stop,
                                    const std::function<void(const std::string&)>& progress) {
  SolverTiming best;
  best.solver = solver;
  // Evolution counts generations, of which none is worth waiting for; it is asked by time.
  const std::string key = solver.starts_with("ert") ? "" : count_key(solver);
  int worse = 0;
  for (int count = 2;; count *= 2) {
    Recipe recipe;
    recipe.solver = solver;
    SolveControl control;
    control.threads = threads;
    control.stop = stop;
    if (key.empty()) {
      control.time_limit_s = std::min(static_cast<double>(count), most_s);
    } else {
      recipe.settings[key] = static_cast<std::int64_t>(count);
    }
    progress(concat(solver, ", ", count, key.empty() ? " s at most" : " iterations"));
    const Stopwatch watch;
    const auto solved = reconstruct(problem.projections, problem.projector, recipe, control);
    if (!solved) return tl::unexpected(solved.error());
    if (stop.stop_requested()) return best;
    const double wall_s = watch.wall_s();
    const auto metrics = compare(problem.truth, solved->volume);
    if (!metrics) return tl::unexpected(metrics.error());
    if (!(metrics->pearson <= best.pearson)) {
      best = {solver,        metrics->pearson >= target, solved->iterations, wall_s,
              watch.cpu_s(), solved->voxel_updates,      metrics->pearson,   metrics->sqmd};
      worse = 0;
    } else {
      ++worse;
    }
    const bool ended_itself = !key.empty() && solved->iterations < count;
    const bool out_of_time =
        key.empty() ? count >= most_s || wall_s < 0.9 * control.time_limit_s : 2 * wall_s > most_s;
    if (best.reached || ended_itself || worse >= 2 || out_of_time) return best;
  }
}

}  // namespace flamefield
