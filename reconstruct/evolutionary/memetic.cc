#include "reconstruct/evolutionary/memetic.h"

#include <algorithm>

#include "reconstruct/evolutionary/evolution.h"
#include "reconstruct/variational/variational.h"

namespace flamefield {

std::vector<SettingField> memetic_fields(MemeticOptions& o) {
  constexpr std::string_view kNotHere[] = {
      "scheme",   "incremental", "sigma_start",  "sigma_generations", "levels",          "coarse_effort",
      "ensemble", "absorption",  "weak_elitism", "strong_elitism",    "calibrate_rounds"};
  std::vector<SettingField> fields = ert_fields(o.ert);
  std::erase_if(fields, [&](const SettingField& field) {
    return std::ranges::find(kNotHere, field.key) != std::end(kNotHere);
  });
  fields.push_back({"sweeps", "", 1, 1e6, "algebraic sweeps of the operator", &o.sweeps});
  return fields;
}

Result<Solution> solve_memetic(const Problem& problem, const MemeticOptions& options) {
  const SolveControl& control = problem.control;
  if (control.checkpoint || !control.resume.empty())
    return invalid_input("checkpoints", "ert-memetic keeps none, it ends within a minute", "use solver ert");
  Monitor monitor(control, options.ert.max_generations);
  const SolveControl quiet{
      .threads = control.threads, .time_limit_s = control.time_limit_s, .stop = control.stop};
  const Problem swept_problem{problem.projector, problem.images, quiet, problem.team,  problem.support,
                              problem.start,     true,           {},    problem.noise, problem.brightness};
  Solution out = solve_variational(swept_problem, {.max_iterations = options.sweeps, .search_iterations = 2 * options.sweeps / 3});
  const float brightest = out.volume.empty() ? 0 : *std::ranges::max_element(out.volume);
  if (!(brightest > 0)) {
    out.notes.push_back("no image shows any light");
    out.stop_reason = StopReason::Fitness;
    return out;
  }
  constexpr float kHeadroom = 1.5;
  const float scale = kHeadroom * brightest;
  const Layout& layout = problem.projector.layout();
  std::vector<float> swept = layout.unpack_volume(out.volume);
  for (float& v : swept) v /= scale;
  const LinearModel model(problem.projector);
  Evolution evolution(problem, options.ert, model, scale);
  if (evolution.is_dark()) {
    out.notes.push_back("the views contradict each other: no voxel is lit in all of them");
    return out;
  }
  evolution.begin_with(swept);
  out.stop_reason = evolution.run(monitor);
  const std::vector<float> evolved = evolution.best();
  for (std::size_t j = 0; j < swept.size(); ++j) swept[j] = 0.5f * (swept[j] + evolved[j]);
  out.volume = layout.pack_volume(swept);
  for (float& v : out.volume) v *= scale;
  out.iterations = evolution.generation();
  out.offspring = evolution.offspring();
  out.voxel_updates += evolution.offspring();
  out.history = monitor.history();
  const std::vector<std::string> notes = evolution.notes();
  out.notes.insert(out.notes.end(), notes.begin(), notes.end());
  return out;
}

}  // namespace flamefield
