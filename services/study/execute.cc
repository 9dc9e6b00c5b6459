#include "services/study/execute.h"

#include <algorithm>
#include <cmath>

#include "proto/version.h"
#include "reconstruct/render.h"

namespace flamefield {

namespace {

// 1 - Z: the mean distance of pixels that are scaled so that the brightest measured one is 1 (Eq. 3).
double fitness_of(const Projections& measured, const Projections& rendered) {
  const double brightest = *std::ranges::max_element(measured.values);
  if (!(brightest > 0)) return 1;
  double sum = 0;
  for (std::size_t i = 0; i < measured.values.size(); ++i)
    sum += std::abs(static_cast<double>(measured.values[i]) - static_cast<double>(rendered.values[i]));
  return 1 - sum / (brightest * static_cast<double>(measured.values.size()));
}

}  // namespace

Result<Executed> execute(const StudyRun& run, const StudyScene& scene, int threads, std::stop_token stop,
                         const std::function<void(double share)>& progress) {
  const RunSettings& s = run.settings;
  SolveControl control{.threads = threads,
                       .time_limit_s = s.time_limit_s,
                       .seed = static_cast<std::uint64_t>(s.seed),
                       .stop = stop};
  if (progress) {
    control.progress = [&](const SolverProgress& p) {
      const double by_count = p.max_iterations > 0 ? static_cast<double>(p.iteration) / p.max_iterations : 0;
      progress(std::min(1.0, std::max(by_count, s.time_limit_s > 0 ? p.elapsed_s / s.time_limit_s : 0)));
    };
  }
  auto solved = reconstruct(scene.images, scene.rig, s.grid(), s.recipe, control);
  if (!solved) return tl::unexpected(solved.error());
  if (solved->stop_reason == StopReason::Cancelled)
    return unavailable("the run was stopped", "half a run says nothing", "start the study again to go on");
  const auto metrics = compare(scene.truth, solved->volume);
  if (!metrics) return tl::unexpected(metrics.error());
  const auto rendered =
      render(solved->volume, scene.rig, {.pixel_samples = s.pixel_samples, .lens = {}, .threads = threads});
  if (!rendered) return tl::unexpected(rendered.error());

  RunRecord r;
  r.id = run.id;
  for (const auto& [key, value] : run.flat) r.settings[key] = text_of(value);
  r.settings["solve.seed"] = concat(s.seed);
  r.solver = solved->solver, r.phantom = phantom_name(s), r.program = std::string(program_version());
  r.metrics = *metrics;
  r.sqmd_2d = mean_sqmd(scene.images, *rendered);
  r.fitness = fitness_of(scene.images, *rendered);
  r.residual = solved->residual, r.iterations = solved->iterations, r.wall_s = solved->wall_s;
  r.stop_reason = std::string(name_of(solved->stop_reason));
  r.notes = std::move(solved->notes);
  r.history = std::move(solved->history);
  const Grid grid = s.grid();
  r.hab_first_mm = grid.origin_mm.y() - grid.lower_mm().y();  // above the bottom of the domain
  r.hab_step_mm = grid.spacing_mm.y();
  return Executed{std::move(r), std::move(solved->volume)};
}

}  // namespace flamefield
