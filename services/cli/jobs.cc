// jobs: what waits and why, what failed, and how to change that.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "proto/utc.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"

namespace flamefield {

namespace {

constexpr std::chrono::seconds kPatience{30};

struct Options {
  DataOption data;
  std::string state;
  GetJobs asked;
  ControlJobs control;
  bool json = false;
};

nlohmann::ordered_json json_of(const Jobs::Row& row) {
  return {{"job", row.id},
          {"run", row.run_id},
          {"state", name_of(row.state)},
          {"priority", name_of(row.priority)},
          {"submitter", row.submitter},
          {"submission", row.submission},
          {"attempt", row.attempt},
          {"worker", row.worker},
          {"created", utc_text(row.created_time_ns)},
          {"why", row.why}};
}

void list(Options options) {
  if (!options.state.empty()) options.asked.state = job_state_from_name(options.state);
  Connection connection = connect_to(options.data);
  const auto jobs = or_fail(connection.operating.dispatcher().ask_for<Jobs>(options.asked, kPatience));
  if (options.json) {
    auto all = nlohmann::ordered_json::array();
    for (const Jobs::Row& row : jobs.rows) all.push_back(json_of(row));
    std::cout << all.dump(2) << '\n';
    return;
  }
  if (jobs.rows.empty()) {
    std::cout << "no such jobs\n";
    return;
  }
  std::cout << fmt::format("{:>8} {:<48} {:<7} {:<12} {:<20} {:>10} {:>4}  {}\n", "JOB", "RUN", "STATE",
                           "PRIORITY", "FOR", "SUBMISSION", "TRY", "WHY");
  for (const Jobs::Row& row : jobs.rows) {
    std::cout << fmt::format("{:>8} {:<48} {:<7} {:<12} {:<20} {:>10} {:>4}  {}\n", row.id, row.run_id,
                             name_of(row.state), name_of(row.priority), row.submitter, row.submission,
                             row.attempt, row.state == JobState::Leased ? "worker " + row.worker : row.why);
  }
}

void control(const Options& options) {
  const ControlJobs& what = options.control;
  if (what.jobs.empty() && what.submission == 0 && !what.all) {
    throw CommandFailure{ExitCode::Usage, concat("nothing to ", name_of(what.action),
                                                 " (no job was named) name jobs, --submission N or --all")};
  }
  Connection connection = connect_to(options.data);
  const auto done = or_fail(connection.operating.dispatcher().ask_for<JobsControlled>(what, kPatience));
  if (options.json) {
    std::cout << nlohmann::ordered_json{{"changed", done.changed}, {"unchanged", done.unchanged}}.dump(2)
              << '\n';
    return;
  }
  std::cout << name_of(what.action) << ": " << done.changed << " jobs changed";
  if (done.unchanged > 0) std::cout << ", " << done.unchanged << " as they were";
  std::cout << '\n';
}

void add_control(CLI::App& jobs, Session& session, JobAction action, const char* help) {
  auto options = std::make_shared<Options>();
  options->control.action = action;
  auto* command = jobs.add_subcommand(std::string(name_of(action)), help);
  add_data(*command, options->data);
  command->add_option("JOB", options->control.jobs, "Numbers, as 'jobs list' prints them");
  command->add_option("--submission", options->control.submission, "All jobs of one submission")
      ->check(CLI::PositiveNumber);
  command->add_flag("--all", options->control.all, "All jobs");
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(concat("Example:\n  flamefield jobs ", name_of(action), " 17 18"));
  command->callback([=, &session] { session.choose([=] { control(*options); }); });
}

}  // namespace

void add_jobs(CLI::App& app, Session& session) {
  auto* jobs = app.add_subcommand("jobs", "What waits and why, what failed; pause, resume, cancel, retry");
  jobs->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* command = jobs->add_subcommand("list", "Jobs, each with why it waits or failed");
  add_data(*command, options->data);
  command->add_option("--state", options->state, "Only these: queued, leased, done, failed")
      ->check(CLI::IsMember({"queued", "leased", "done", "failed"}));
  command->add_option("--submission", options->asked.submission, "Only those that were asked for together");
  command->add_option("--limit", options->asked.limit, "At most so many, the newest")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer("Example:\n  flamefield jobs list --state failed");
  command->callback([=, &session] { session.choose([=] { list(*options); }); });
  add_control(*jobs, session, JobAction::Pause,
              "Give them out no more; what runs, runs on. --all: later ones too");
  add_control(*jobs, session, JobAction::Resume, "Undo pause");
  add_control(*jobs, session, JobAction::Cancel, "They fail as 'cancelled', also while they run");
  add_control(*jobs, session, JobAction::Retry,
              "Failed jobs wait again. --all: all but the cancelled, which must be named");
}

}  // namespace flamefield
