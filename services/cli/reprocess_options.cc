#include "services/cli/reprocess_options.h"

#include <CLI/CLI.hpp>

#include "proto/job.h"
#include "proto/utc.h"
#include "reconstruct/solver.h"
#include "services/cli/app.h"
#include "services/config/recipe_file.h"
#include "services/reprocess/sweep.h"
#include "services/scheduler/cron.h"
#include "services/store/rig_file.h"

namespace flamefield {

std::pair<ReprocessOrder, std::optional<Rig>> ReprocessOptions::read() const {
  ReprocessOrder complete = order;
  if (!recipe.empty() || !solver.empty()) {
    Recipe changed = recipe.empty() ? Recipe{} : or_usage(read_recipe(recipe, validate_recipe));
    if (!solver.empty()) changed.solver = solver;
    or_usage(validate_recipe(changed));
    complete.recipe = toml_of(changed);
  }
  or_usage(sweep_combinations(complete.sweep));
  std::optional<Rig> stored;
  if (!rig.empty()) {
    stored = or_usage(read_rig(rig));
    complete.rig_id = fingerprint(*stored);
  }
  return {std::move(complete), std::move(stored)};
}

void add_reprocess_options(CLI::App& command, ReprocessOptions& options) {
  command.add_option(
      "--where", options.order.where,
      "Filter; with fields of runs it repeats runs, else it takes sets (see 'flamefield runs fields')");
  command.add_flag("--stale", options.order.stale,
                   "Only volumes that a newer accepted calibration made stale, with that calibration");
  command.add_option("--recipe", options.recipe, "Recipe in place of each run's own; its [prepare] stays");
  command.add_option("--solver", options.solver, "Solver in place of each run's own, with its defaults");
  command.add_option("--rig", options.rig, "rig.yaml in place of each run's own");
  command
      .add_option("--set", options.order.settings,
                  "TABLE.KEY=VALUE, laid over the recipe; as often as needed")
      ->allow_extra_args(false);
  command
      .add_option("--sweep", options.order.sweep,
                  "TABLE.KEY=A,B,C: once for each value; several make every combination")
      ->allow_extra_args(false);
}

Schedule ScheduleOptions::schedule(const std::string& name, const std::string& cron,
                                   const ReprocessOrder& order) const {
  Schedule made;
  made.name = name;
  made.cron = cron;
  made.zone = zone;
  made.missed = missed_runs_from_name(missed).value_or(MissedRuns::Once);
  made.overlap = overlap_runs_from_name(overlap).value_or(OverlapRuns::Skip);
  made.order = order;
  made.created_time_ns = utc_now_ns();
  (void)or_usage(Cron::parse(cron));
  (void)or_usage(TimeZone::find(zone));
  if (!is_file_safe(name))
    throw CommandFailure{ExitCode::Usage,
                         concat("schedule '", name, "' (not a name) use letters, digits, '.', '_' and '-'")};
  return made;
}

void add_schedule_options(CLI::App& command, ScheduleOptions& options) {
  command.add_option("--zone", options.zone, "Time zone of the cron expression, e.g. Asia/Tokyo")
      ->capture_default_str();
  command.add_option("--missed", options.missed, "Due while the service was down: run once, or skip")
      ->check(CLI::IsMember({"once", "skip"}))
      ->capture_default_str();
  command
      .add_option("--overlap", options.overlap,
                  "Due while the last run's jobs are left: skip, or queue behind")
      ->check(CLI::IsMember({"skip", "queue"}))
      ->capture_default_str();
}

}  // namespace flamefield
