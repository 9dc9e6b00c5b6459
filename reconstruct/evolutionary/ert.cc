#include "reconstruct/evolutionary/ert.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "reconstruct/evolutionary/calibration_free.h"
#include "reconstruct/evolutionary/evolution.h"
#include "reconstruct/evolutionary/generational.h"
#include "reconstruct/monitor.h"
#include "reconstruct/statistical/mlem.h"

namespace flamefield {

std::vector<SettingField> ert_fields(ErtOptions& o) {
  static constexpr std::array<std::string_view, 2> kSchemes = {"brood", "paper"};
  return {
      {"scheme", "", 0, 0, "brood: all better offspring join the best; paper: Algorithms 1 and 2 as written",
       choice_of(o.scheme, kSchemes)},
      {"pop_size", "", 1, 65536, "chromosomes", &o.pop_size},
      {"max_generations", "", 1, 2e9, "generations", &o.max_generations},
      {"fit_threshold", "", 0, 1, "stop when 1 - Z reaches it", &o.fit_threshold},
      {"lp", "", 0.05, 16, "p of the distance L_p (Eq. 2)", &o.lp},
      {"mutation_rate", "", 0, 1, "probability of mutation", &o.mutation_rate},
      {"mutation_intensity", "voxels", 0, 1e9, "voxels a mutation changes", &o.mutation_intensity},
      {"sigma", "", 0, 100, "standard deviation of a mutation; 1 is the largest voxel", &o.sigma},
      {"annihilation_rate", "", 0, 1, "probability of annihilation", &o.annihilation_rate},
      {"annihilation_intensity", "voxels", 0, 1e9, "voxels set to zero", &o.annihilation_intensity},
      {"filter_rate", "", 0, 1, "probability of the local filter", &o.filter_rate},
      {"filter_intensity", "voxels", 0, 1e9, "voxels filtered", &o.filter_intensity},
      {"weak_elitism", "", 0, 1, "paper: the best is always one parent", &o.weak_elitism},
      {"strong_elitism", "", 0, 1, "paper: the best survives unaltered", &o.strong_elitism},
      {"mask_samples", "", 1, 1e9, "voxels in the stochastic mask", &o.mask_samples},
      {"ma_start", "", 0, 2e9, "generation from which the mask follows the best", &o.ma_start},
      {"steps", "", 1, 2e9, "generations between new masks", &o.steps},
      {"sigma_start", "", 0, 100, "paper: sigma in the beginning; 0: as later", &o.sigma_start},
      {"sigma_generations", "", 1, 1e12, "paper: generations in which its excess falls to 1/e",
       &o.sigma_generations},
      {"incremental", "", 0, 1, "paper: derive images from the parents'; false renders all, slowly",
       &o.incremental},
      {"creep_rate", "", 0, 1, "brood: share of mutations around the voxel's own value", &o.creep_rate},
      {"crossover_rate", "", 0, 1, "brood: share of means of the best and another", &o.crossover_rate},
      {"adaptive", "", 0, 1, "brood: rates and the sigma of each voxel follow success", &o.adaptive},
      {"levels", "", 1, 8, "brood: grids from coarse to fine", &o.levels},
      {"coarse_effort", "", 0, 1e6, "brood: offspring per voxel on coarse grids", &o.coarse_effort},
      {"roughness", "", 0, 1e3, "brood: weight of uneven fields; 0: none", &o.roughness},
      {"roughness_edge", "", 1e-6, 1e3,
       "brood: second differences above count linearly, share of the brightest", &o.roughness_edge},
      {"migrate_every", "", 1, 1e6, "brood: generations between exchanges of islands, one on each MPI rank",
       &o.migrate_every},
      {"tolerance", "", 0, 1, "brood: stop when 8 offspring per voxel improve less", &o.tolerance},
      {"render_every", "", 1, 2e9, "generations between full renderings that remove rounding",
       &o.render_every},
      {"columns_budget_mib", "MiB", 0, 1e9, "columns of A that need more are worked out at every use",
       &o.columns_budget_mib},
      {"ensemble", "", 1, 1000, "independent runs; their mean and deviation are the result", &o.ensemble},
      {"calibrate_rounds", "", 0, 100,
       "brood: cameras are corrected between so many solves, experimental; 0: never", &o.calibrate_rounds},
      {"absorption", "1/(unit mm)", 0, 1e9, "self-absorption per emission and mm", &o.absorption}};
}

namespace {

constexpr float kHeadroom = 2;

// What a voxel value of 1 stands for: chromosomes live in [0, 1], so it must be above the brightest voxel. A
// few iterations of OSEM tell its order of magnitude; thin fronts come out too dim by then.
float largest_voxel(const Problem& problem) {
  const SolveControl quiet{.threads = problem.control.threads, .stop = problem.control.stop};
  const Solution rough = solve_mlem({problem.projector, problem.images, quiet, problem.team},
                                    {.max_iterations = 6, .subsets = 5, .smoothing = 0.1});
  const float warm = problem.start.empty() ? 0 : *std::ranges::max_element(problem.start);
  return kHeadroom * std::max(warm, *std::ranges::max_element(rough.volume));
}

Result<Solution> solve_once(const Problem& problem, const ErtOptions& options) {
  Solution out;
  const Layout& layout = problem.projector.layout();
  out.volume.assign(layout.voxels(), 0);
  // What a gas absorbs, a linear solver does not see.
  const float scale = (options.absorption > 0 ? 2.0f : 1.0f) * largest_voxel(problem);
  if (!(scale > 0)) {
    out.stop_reason = StopReason::Fitness;
    out.notes.push_back("no image shows any light");
    return out;
  }
  const auto model =
      make_model(problem.projector, options.absorption * static_cast<double>(problem.brightness));
  if (options.scheme == ErtOptions::Scheme::Paper) return evolve_generations(problem, options, *model, scale);

  Monitor monitor(problem.control, options.max_generations);
  Evolution evolution(problem, options, *model, scale);
  if (evolution.is_dark()) {
    out.stop_reason = StopReason::Fitness;
    out.notes.push_back("the views contradict each other: no voxel is lit in all of them");
    return out;
  }
  if (!problem.control.resume.empty()) {
    if (auto ok = evolution.resume(problem.control.resume); !ok) return tl::unexpected(ok.error());
  } else if (!problem.start.empty()) {
    std::vector<float> field = layout.unpack_volume(start_of(problem));
    for (float& v : field) v = std::clamp(v / scale, 0.0f, 1.0f);
    evolution.begin_with(std::move(field));
  }
  out.stop_reason = evolution.run(monitor);
  out.iterations = evolution.generation();
  out.volume = layout.pack_volume(evolution.best());
  for (float& v : out.volume) v *= scale;
  if (!model->is_linear()) {
    out.images.resize(layout.pixels());
    model->render(problem.team, out.volume, out.images);
  }
  out.offspring = out.voxel_updates = evolution.offspring();
  out.history = monitor.history();
  out.notes = evolution.notes();
  return out;
}

// Mean and standard deviation over independent seeds (the paper's Section 3.5 with 15 runs).
Result<Solution> solve_ensemble(const Problem& problem, const ErtOptions& options) {
  Solution out;
  std::vector<double> sum(problem.projector.layout().voxels(), 0), squares(sum);
  SolveControl control = problem.control;
  control.time_limit_s /= options.ensemble;
  int runs = 0;
  for (int k = 0; k < options.ensemble && !control.stop.stop_requested(); ++k) {
    control.seed = problem.control.seed + static_cast<std::uint64_t>(k);
    const Problem one{
        problem.projector, problem.images,       control,      problem.team,  problem.support,
        problem.start,     problem.non_negative, problem.stop, problem.noise, problem.brightness};
    auto run = solve_once(one, options);
    if (!run) return run;
    for (std::size_t j = 0; j < sum.size(); ++j) {
      const auto v = static_cast<double>(run->volume[j]);
      sum[j] += v;
      squares[j] += v * v;
    }
    ++runs;
    const double offspring = out.offspring + run->offspring, updates = out.voxel_updates + run->voxel_updates;
    out = std::move(*run);
    out.offspring = offspring;
    out.voxel_updates = updates;
  }
  if (runs == 0) return solve_once(problem, options);
  out.sigma.resize(sum.size(), 0);
  for (std::size_t j = 0; j < sum.size(); ++j) {
    const double mean = sum[j] / runs;
    out.volume[j] = static_cast<float>(mean);
    if (runs > 1)
      out.sigma[j] =
          static_cast<float>(std::sqrt(std::max(0.0, (squares[j] - runs * mean * mean) / (runs - 1))));
  }
  out.images.clear();
  out.notes.push_back(concat("mean of ", runs, " independent runs; history and notes are of the last"));
  return out;
}

}  // namespace

Result<Solution> solve_ert(const Problem& problem, const ErtOptions& options) {
  const bool is_one_run = options.ensemble == 1 && options.calibrate_rounds == 0;
  if (!is_one_run && (problem.control.checkpoint || !problem.control.resume.empty())) {
    return invalid_input("checkpoints", "only a single run keeps them",
                         "set ert.ensemble = 1 and ert.calibrate_rounds = 0");
  }
  if (!problem.start.empty() &&
      (options.scheme == ErtOptions::Scheme::Paper || options.calibrate_rounds > 0)) {
    return invalid_input("a warm start", "the paper's scheme and corrected cameras begin with a dark field",
                         "leave it out, or set ert.scheme = \"brood\" and ert.calibrate_rounds = 0");
  }
  if (problem.control.ranks && problem.control.ranks->count() > 1 &&
      (!is_one_run || options.scheme == ErtOptions::Scheme::Paper || problem.control.checkpoint ||
       !problem.control.resume.empty())) {
    return invalid_input(
        "islands on several ranks", "only a single run of the brood scheme without checkpoints has them",
        "run it without ranks, or set ert.scheme = \"brood\", ert.ensemble = 1 and ert.calibrate_rounds = 0");
  }
  if (options.calibrate_rounds > 0) return solve_with_cameras(problem, options);
  return options.ensemble > 1 ? solve_ensemble(problem, options) : solve_once(problem, options);
}

}  // namespace flamefield
