#include "services/study/estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>

#include "reconstruct/solver.h"
#include "services/study/runner.h"

namespace flamefield {

namespace {

constexpr double kTrial_s = 2;

// How many iterations or generations a recipe asks for; NaN for a solver that counts none.
double iterations_of(const Recipe& recipe) {
  for (const SettingDoc& doc : settings_of(recipe.solver)) {
    if (doc.key != "max_iterations" && doc.key != "max_generations") continue;
    const auto given = recipe.settings.find(recipe.solver + "." + doc.key);
    return given == recipe.settings.end() ? std::strtod(doc.default_value.c_str(), nullptr)
                                          : number_of(given->second).value_or(NAN);
  }
  return std::numeric_limits<double>::quiet_NaN();
}

// Chromosomes a generation: the other factor of an evolutionary solver's time.
double population_of(const Recipe& recipe) {
  for (const SettingDoc& doc : settings_of(recipe.solver)) {
    if (doc.key != "population_size" && doc.key != "pop_size") continue;
    const auto given = recipe.settings.find(recipe.solver + "." + doc.key);
    return given == recipe.settings.end() ? std::strtod(doc.default_value.c_str(), nullptr)
                                          : number_of(given->second).value_or(1);
  }
  return 1;
}

struct Trial {
  double fixed_s = 0;          // of a solve that ended by itself
  double per_iteration_s = 0;  // else
};

Result<Trial> try_out(const StudyRun& run, StudyScenes& scenes, std::stop_token stop) {
  const auto scene = scenes.get(run.settings, 0);
  if (!scene) return tl::unexpected(scene.error());
  const SolveControl control{.threads = 1,
                             .time_limit_s = kTrial_s,
                             .seed = static_cast<std::uint64_t>(run.settings.seed),
                             .stop = std::move(stop)};
  const auto solved =
      reconstruct((*scene)->images, (*scene)->rig, run.settings.grid(), run.settings.recipe, control);
  if (!solved) return tl::unexpected(solved.error());
  if (solved->stop_reason != StopReason::TimeLimit) return Trial{solved->wall_s, 0};
  // What comes before the first iteration is there once; the rest grows with their number.
  const auto& history = solved->history;
  const double population = population_of(run.settings.recipe);
  if (history.size() < 2) return Trial{0, solved->wall_s / std::max(1, solved->iterations) / population};
  const HistoryPoint &first = history.front(), &last = history.back();
  const double each_s = (last.elapsed_s - first.elapsed_s) / std::max(1, last.iteration - first.iteration);
  return Trial{std::max(0.0, solved->wall_s - each_s * solved->iterations), each_s / population};
}

}  // namespace

Result<std::vector<RunEstimate>> estimate_runs(const std::vector<Study>& studies, const StudyPlan& plan,
                                               const RecordStore* store, StudyScenes& scenes,
                                               std::stop_token stop,
                                               const std::function<void(const std::string&)>& progress) {
  std::vector<RunEstimate> out;
  std::map<std::string, Trial> trials;
  std::set<std::string> known;
  for (const StudyRun& run : plan.runs) {
    if (!studies[run.study].solve) continue;
    RunEstimate estimate{&run};
    estimate.is_done = store && is_done(studies[run.study], run, *store);
    estimate.is_twin = !known.insert(run.id).second;
    if (!estimate.is_done && !estimate.is_twin && !stop.stop_requested()) {
      const Recipe& recipe = run.settings.recipe;
      const std::string name = concat(phantom_name(run.settings), ", ", recipe.solver);
      auto trial = trials.find(name);
      if (trial == trials.end()) {
        progress(name);
        const auto tried = try_out(run, scenes, stop);
        if (!tried) return tl::unexpected(tried.error());
        trial = trials.emplace(name, *tried).first;
      }
      const Trial& t = trial->second;
      estimate.seconds = t.fixed_s;
      if (t.per_iteration_s > 0)
        estimate.seconds += t.per_iteration_s * iterations_of(recipe) * population_of(recipe);
      if (run.settings.time_limit_s > 0 && !(estimate.seconds <= run.settings.time_limit_s))
        estimate.seconds = run.settings.time_limit_s;
    }
    out.push_back(estimate);
  }
  return out;
}

}  // namespace flamefield
