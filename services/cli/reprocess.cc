#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "proto/utc.h"
#include "reconstruct/solver.h"
#include "services/api/records_json.h"
#include "services/cli/cluster_options.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/progress.h"
#include "services/cli/reprocess_options.h"
#include "services/ledger/query.h"
#include "services/ledger/reader.h"
#include "services/reprocess/plan.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;

struct Options {
  DataOption data;
  ReprocessOptions what;
  ClusterOptions cluster;
  bool data_given = false;
  ScheduleOptions when;
  std::string every, name, executor = "local";
  bool dry_run = false, preview = false, wait = false, json = false;
};

std::string duration_text(double seconds) {
  if (seconds < 120) return fmt::format("{:.1f} s", seconds);
  if (seconds < 7200) return fmt::format("{:.0f} min", seconds / 60);
  return fmt::format("{:.1f} h", seconds / 3600);
}

void print_plan(const ReprocessPlan& plan, bool as_json) {
  if (as_json) {
    const bool known = plan.past_runs > 0;
    std::cout << Json{{"asked", plan.asked},
                      {"identical", plan.identical.size()},
                      {"volumes", plan.volumes()},
                      {"estimated_worker_s", known ? Json(plan.seconds) : Json(nullptr)},
                      {"estimated_peak_rss_mib", known ? Json(plan.peak_rss_mib) : Json(nullptr)},
                      {"past_runs", plan.past_runs}}
                     .dump(2)
              << '\n';
    return;
  }
  std::cout << plan.asked << " volumes asked for, " << plan.identical.size()
            << " of them are there or in line, " << plan.volumes() << " to make\n";
  if (plan.volumes() == 0) return;
  if (plan.past_runs == 0)
    std::cout << "no estimate: nothing was recorded with these solvers yet (--preview makes one)\n";
  else
    std::cout << "estimate: " << duration_text(plan.seconds) << " of one worker, "
              << fmt::format("{:.0f} MiB", plan.peak_rss_mib) << " at most (from " << plan.past_runs
              << " recorded runs)\n";
}

Submitted submit(const Options& options, const ReprocessPlan& plan, const std::optional<Rig>& rig) {
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  const std::chrono::seconds patience(60);
  if (rig) or_fail(connection.client.ask_for<RigStored>(PutRig{*rig}, patience));
  return or_fail(submit_plan(
      plan, [&](const Submit& order) { return connection.client.ask_for<Submitted>(order, patience); }));
}

std::vector<Status::Worker> connected_workers(const Options& options) {
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  return or_fail(connection.client.ask_for<Status>(GetStatus{}, std::chrono::seconds(10))).workers;
}

// Waits for the runs; a job of them that fails ends the command with its reason.
void wait_for(const Options& options, const Submitted& submitted, const Session& session) {
  ProgressBar bar("reprocess");
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  auto jobs = or_fail(LedgerReader::open(options.data.dir));
  const std::set<std::int64_t> ours(submitted.job_ids.begin(), submitted.job_ids.end());
  const auto& run_ids = submitted.run_ids;
  std::size_t done = 0;
  while (done < run_ids.size()) {
    session.check_stop();
    const auto run = ledger.run(run_ids[done]);
    if (run && run->state == JobState::Done && !run->retired) {
      const std::string& id = run_ids[done++];
      bar.update(static_cast<double>(done), static_cast<double>(run_ids.size()), id);
      continue;
    }
    for (const JobRow& job : or_fail(jobs.jobs(JobState::Failed))) {
      if (ours.contains(job.id))
        throw CommandFailure{ExitCode::Failed, concat("run ", job.run_id, " failed (", job.reason,
                                                      ") mend the cause and reprocess again")};
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

void print_runs(const Options& options, const std::vector<std::string>& run_ids) {
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  Json all = Json::array();
  for (const std::string& id : run_ids) {
    const WorkRow row = or_fail(ledger.run(id));
    all.push_back(json_of(row));
    if (options.json) continue;
    std::cout << fmt::format("{}: {}, {} iterations, residual {:.4f}, {:.2f} s, {}\n", id, row.run.solver,
                             row.run.iterations, row.run.residual, row.run.timings.solve_s,
                             (options.data.dir / row.run.volume_path).string());
  }
  if (options.json) std::cout << all.dump(2) << '\n';
}

void add_to_schedules(const Options& options, const ReprocessOrder& order, const std::optional<Rig>& rig) {
  const std::string name =
      options.name.empty() ? concat("reprocess-", utc_now_ns() / 1'000'000'000) : options.name;
  const Schedule schedule = options.when.schedule(name, options.every, order);
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  const std::chrono::seconds patience(10);
  if (rig) or_fail(connection.client.ask_for<RigStored>(PutRig{*rig}, patience));
  or_fail(connection.client.ask_for<Accepted>(PutSchedule{schedule}, patience));
  std::cout << "schedule " << name << ": " << options.every << " (" << options.when.zone
            << "); see 'flamefield schedule list'\n";
}

PilotSize size_of_pilots(const Options& options, const ReprocessPlan& plan,
                         const std::optional<ClusterPlace>& place) {
  if (!place) return {};
  const bool known = plan.past_runs > 0;
  return options.cluster.size({plan.volumes(), known ? plan.seconds : 0, known ? plan.peak_rss_mib : 0},
                              place->config);
}

std::string would_hire(const PilotSize& size) {
  return fmt::format("pilots: {} of {} cores, {} MiB and {} min each", size.pilots, size.cores,
                     size.memory_mib, size.minutes);
}

void run(Options& options, const Session& session) {
  const bool on_cluster = options.executor == "slurm";
  if (on_cluster && !options.every.empty())
    throw CommandFailure{ExitCode::Usage,
                         "--every with --executor slurm (a schedule places jobs, it hires nobody) "
                         "leave one out, and run 'flamefield cluster up' when pilots are needed"};
  std::optional<ClusterPlace> place;
  if (on_cluster || !options.cluster.config.empty())
    place = options.cluster.place(options.data, options.data_given);
  const auto [order, rig] = options.what.read();
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  ReprocessPlan plan = or_usage(plan_reprocessing(ledger, order, validate_recipe, utc_now_ns()));
  if (!options.every.empty() && !options.dry_run) return add_to_schedules(options, order, rig);
  if (options.preview) plan = preview_of(plan);
  const PilotSize size = size_of_pilots(options, plan, place);
  if (options.dry_run || plan.volumes() == 0) {
    print_plan(plan, options.json);
    if (on_cluster && !options.json && plan.volumes() > 0) std::cout << would_hire(size) << '\n';
    return;
  }
  if (!options.json) print_plan(plan, false);
  // Pilots first: where Slurm refuses, nothing is put in line; where this is cut short, they find nothing and
  // end.
  std::optional<Hired> hired;
  if (on_cluster) hired = hire_pilots(*place, size, false, connected_workers(options));
  if (hired && !options.json) std::cout << text_of(*hired, size) << '\n';
  const Submitted submitted = submit(options, plan, rig);
  if (options.preview || options.wait) {
    wait_for(options, submitted, session);
    return print_runs(options, submitted.run_ids);
  }
  if (options.json)
    std::cout << Json{{"jobs", submitted.job_ids.size()},
                      {"identical", submitted.identical},
                      {"pilots", hired ? Json(hired->name) : Json(nullptr)}}
                     .dump(2)
              << '\n';
  else
    std::cout << submitted.job_ids.size()
              << " jobs are in line; watch them with 'flamefield status --watch'\n";
}

}  // namespace

void add_reprocess(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "reprocess", "Do recorded work again, with another recipe or calibration, now or at set times");
  add_data(*command, options->data);
  add_reprocess_options(*command, options->what);
  command->add_option("--every", options->every, "Cron expression: store this as a schedule instead");
  command->add_option("--name", options->name, "Of the schedule");
  add_schedule_options(*command, options->when);
  command
      ->add_option(
          "--executor", options->executor,
          "local: whoever is connected; slurm: also pilots that are submitted for this, sized by the "
          "estimate")
      ->check(CLI::IsMember({"local", "slurm"}))
      ->capture_default_str();
  add_cluster_place(*command, options->cluster);
  add_cluster_size(*command, options->cluster);
  command->add_flag("--dry-run", options->dry_run, "Only say what would be done, and what it would take");
  command->add_flag("--preview", options->preview, "Do the first volume only, at once, and wait for it");
  command->add_flag("--wait", options->wait, "Wait until everything is done");
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(
      "Examples:\n"
      "  flamefield reprocess --where \"capture ~ '*-burst' and residual > 0.1\" --recipe better.toml "
      "--dry-run\n"
      "  flamefield reprocess --where 'solver = hessian' --sweep hessian.beta=0.5,1,2 --preview\n"
      "  flamefield reprocess --where \"capture = 'monday'\" --recipe better.toml --executor slurm --config "
      "lab.toml\n"
      "  flamefield reprocess --stale --every '30 2 * * mon-fri' --zone Europe/Vienna");
  command->callback([=, &session] {
    options->data_given = command->count("--data") > 0;
    session.choose([=, &session] { run(*options, session); });
  });
}

}  // namespace flamefield
