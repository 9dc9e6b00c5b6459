#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "reconstruct/solver.h"
#include "services/api/records_json.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/reprocess_options.h"
#include "services/ledger/query.h"
#include "services/reprocess/plan.h"
#include "services/scheduler/cron.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;
constexpr std::chrono::seconds kPatience{30};

struct Options {
  DataOption data;
  ReprocessOptions what;
  ScheduleOptions when;
  std::string name, cron;
  bool json = false;
};

std::string next_due(const Schedule& schedule) {
  const auto cron = Cron::parse(schedule.cron);
  const auto zone = TimeZone::find(schedule.zone);
  const auto due = cron && zone ? cron->next(utc_now_ns(), *zone) : std::nullopt;
  return due ? utc_text(*due) : "never";
}

std::string order_text(const ReprocessOrder& order) {
  std::string text = order.stale ? "stale " : "";
  if (!order.where.empty()) text += concat("where ", order.where, " ");
  if (!order.rig_id.empty()) text += concat("rig ", order.rig_id, " ");
  if (!order.recipe.empty()) text += "another recipe ";
  for (const std::string& setting : order.settings) text += setting + " ";
  for (const std::string& sweep : order.sweep) text += concat("sweep ", sweep, " ");
  return text.empty() ? "all sets" : text;
}

void list(const Options& options, const Session&) {
  const auto rows = or_fail(or_fail(LedgerQuery::open(options.data.dir)).schedules());
  Json all = Json::array();
  for (const ScheduleRow& row : rows) {
    const Schedule& s = row.schedule;
    all.push_back({{"name", s.name},
                   {"cron", s.cron},
                   {"zone", s.zone},
                   {"missed", name_of(s.missed)},
                   {"overlap", name_of(s.overlap)},
                   {"order", order_text(s.order)},
                   {"next_due", next_due(s)},
                   {"last_run", utc_text(row.last_run_ns)},
                   {"last_outcome", row.last_outcome},
                   {"last_text", row.last_text},
                   {"jobs_left", row.jobs_left}});
  }
  if (options.json) {
    std::cout << all.dump(2) << '\n';
    return;
  }
  std::cout << fmt::format("{:<24} {:<18} {:<16} {:<25} {:<11} {:>5}  {}\n", "SCHEDULE", "CRON", "ZONE",
                           "NEXT (UTC)", "LAST", "LEFT", "WHAT");
  for (const Json& row : all)
    std::cout << fmt::format("{:<24} {:<18} {:<16} {:<25} {:<11} {:>5}  {}\n", row["name"].get<std::string>(),
                             row["cron"].get<std::string>(), row["zone"].get<std::string>(),
                             row["next_due"].get<std::string>(), row["last_outcome"].get<std::string>(),
                             row["jobs_left"].get<int>(), row["order"].get<std::string>());
  if (rows.empty()) std::cout << "no schedules: add one with 'flamefield schedule add'\n";
}

void add(const Options& options, const Session&) {
  const auto [order, rig] = options.what.read();
  const Schedule schedule = options.when.schedule(options.name, options.cron, order);
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  (void)or_usage(plan_reprocessing(ledger, order, validate_recipe, utc_now_ns()));  // its faults show now
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  if (rig) or_fail(connection.client.ask_for<RigStored>(PutRig{*rig}, kPatience));
  or_fail(connection.client.ask_for<Accepted>(PutSchedule{schedule}, kPatience));
  std::cout << schedule.name << ": next " << next_due(schedule) << '\n';
}

void remove(const Options& options, const Session&) {
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  or_fail(connection.client.ask_for<Accepted>(DropSchedule{options.name}, kPatience));
  std::cout << options.name << " removed\n";
}

void run_now(const Options& options, const Session&) {
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  const auto rows = or_fail(ledger.schedules());
  const auto found =
      std::ranges::find_if(rows, [&](const ScheduleRow& row) { return row.schedule.name == options.name; });
  if (found == rows.end())
    throw CommandFailure{
        ExitCode::Usage,
        concat("schedule ", options.name, " (there is none of this name) see 'flamefield schedule list'")};
  const ReprocessPlan plan =
      or_fail(plan_reprocessing(ledger, found->schedule.order, validate_recipe, utc_now_ns()));
  DispatcherConnection connection = connect_to_dispatcher(options.data);
  const Submitted submitted = or_fail(submit_plan(
      plan, [&](const Submit& order) { return connection.client.ask_for<Submitted>(order, kPatience); }));
  or_fail(connection.client.ask_for<Accepted>(
      ScheduleRan{options.name, 0, utc_now_ns(), "submitted",
                  concat(submitted.job_ids.size(), " jobs, ", submitted.identical, " identical; by hand"),
                  submitted.job_ids},
      kPatience));
  std::cout << submitted.job_ids.size() << " jobs are in line, " << submitted.identical
            << " are there already\n";
}

CLI::App* sub(CLI::App& parent, Session& session, const char* name, const char* help, const char* example,
              const std::shared_ptr<Options>& options, void (*work)(const Options&, const Session&)) {
  auto* command = parent.add_subcommand(name, help);
  add_data(*command, options->data);
  command->footer(concat("Example:\n  flamefield schedule ", example));
  command->callback([=, &session] { session.choose([=, &session] { work(*options, session); }); });
  return command;
}

}  // namespace

void add_schedule(CLI::App& app, Session& session) {
  auto* schedule = app.add_subcommand("schedule", "Reprocessing at set times");
  schedule->require_subcommand(1);
  auto options = std::make_shared<Options>();
  sub(*schedule, session, "list", "What is due when, and what became of it", "list", options, &list)
      ->add_flag("--json", options->json, "Print as JSON");

  options = std::make_shared<Options>();
  auto* adding = sub(*schedule, session, "add", "Store a schedule, or replace one",
                     "add nightly '30 2 * * *' --zone Asia/Tokyo --where 'time > -1d and residual > 0.1' "
                     "--recipe better.toml",
                     options, &add);
  adding->add_option("NAME", options->name, "Of the schedule")->required();
  adding->add_option("CRON", options->cron, "minute hour day-of-month month day-of-week, or @daily")
      ->required();
  add_reprocess_options(*adding, options->what);
  add_schedule_options(*adding, options->when);

  options = std::make_shared<Options>();
  sub(*schedule, session, "remove", "Its jobs in line stay there", "remove nightly", options, &remove)
      ->add_option("NAME", options->name, "Of the schedule")
      ->required();

  options = std::make_shared<Options>();
  sub(*schedule, session, "run-now", "Do it once, now, whatever its time", "run-now nightly", options,
      &run_now)
      ->add_option("NAME", options->name, "Of the schedule")
      ->required();
}

}  // namespace flamefield
