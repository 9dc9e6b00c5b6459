#include "services/cli/app.h"

#include <sys/resource.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdlib>
#include <iostream>

#include "proto/check.h"
#include "proto/version.h"
#include "services/cli/commands.h"
#include "services/cli/on_ranks.h"
#include "services/cli/plan.h"
#include "services/config/suggestion.h"
#include "services/process/signals.h"

namespace flamefield {

namespace {

// One row a command, in the order of the help.
constexpr std::array kCommands = {
    &add_demo,    &add_serve,  &add_capture, &add_runs,     &add_status,      &add_calibrate,
    &add_phantom, &add_ring,   &add_render,  &add_prepare,  &add_reconstruct, &add_evaluate,
    &add_bench,   &add_study,  &add_show,    &add_convert,  &add_simulate,    &add_cameras,
    &add_doctor,  &add_replay, &add_jobs,    &add_selftest, &add_reprocess,   &add_schedule,
    &add_rigs,    &add_keys,   &add_ledger,  &add_plan,     &add_cluster};

int report(ExitCode code, const std::string& message) {
  std::cerr << "flamefield: " << message << '\n';
  return static_cast<int>(code);
}

// The ranks that run the command together; null: there is one process.
bool leads(const Ranks* ranks) {
  return !ranks || ranks->rank() == 0;
}

// What every rank meets alike is told by the first.
int report(const Ranks* ranks, ExitCode code, const std::string& message) {
  return leads(ranks) ? report(code, message) : static_cast<int>(code);
}

// What no other rank may know of. They wait for this one, until the launcher ends them.
int report_unforeseen(const Ranks* ranks, const std::string& message) {
  if (!ranks) return report(ExitCode::Failed, message);
  std::_Exit(report(ExitCode::Failed, concat("rank ", ranks->rank(), ": ", message)));
}

// A misspelt command is worth a better answer than the parser's.
void check_command_name(const CLI::App& app, int argc, char** argv) {
  if (argc < 2 || argv[1][0] == '-') return;
  std::vector<std::string> names;
  for (const CLI::App* command : app.get_subcommands({})) names.push_back(command->get_name());
  if (std::find(names.begin(), names.end(), argv[1]) != names.end()) return;
  throw CommandFailure{ExitCode::Usage,
                       concat("unknown command '", argv[1], "' (there is none of this name) ",
                              suggest(argv[1], {names.begin(), names.end()}))};
}

const CLI::App& chosen_command(const CLI::App& app) {
  const auto chosen = app.get_subcommands();
  return chosen.empty() ? app : chosen_command(*chosen.front());
}

std::string full_name(const CLI::App& app) {
  return app.get_parent() ? full_name(*app.get_parent()) + " " + app.get_name() : app.get_name();
}

int parse_and_run(CLI::App& app, Session& session, const Ranks* ranks, int argc, char** argv) {
  try {
    check_command_name(app, argc, argv);
    app.parse(argc, argv);
    session.run();
    std::cout.flush();
    return static_cast<int>(ExitCode::Done);
  } catch (const CLI::Success& help_or_version) {
    return leads(ranks) ? app.exit(help_or_version) : static_cast<int>(ExitCode::Done);
  } catch (const CLI::ParseError& error) {
    return report(ranks, ExitCode::Usage,
                  concat(error.what(), " (the command line does not fit) see '",
                         full_name(chosen_command(app)), " --help'"));
  } catch (const CommandFailure& failure) {
    return report(ranks, failure.code, failure.message);
  } catch (const std::bad_alloc&) {
    return report_unforeseen(ranks, "out of memory (the data do not fit) use a smaller grid");
  } catch (const ContractViolation& violation) {
    return report_unforeseen(ranks, concat("internal fault (", violation.what(), ") please report it"));
  } catch (const std::exception& exception) {
    return report_unforeseen(ranks, concat("unexpected failure (", exception.what(), ") please report it"));
  }
}

}  // namespace

void Session::check_stop() const {
  if (stop_.stop_requested())
    throw CommandFailure{ExitCode::Failed, "stopped (on request) nothing was written"};
}

namespace {

int run_program(const std::string& name, Ranks* ranks, int argc, char** argv) {
  const SignalStop signals;
  std::string typed = name;
  for (int i = 1; i < argc; ++i) typed.append(" ").append(argv[i]);
  Session session(signals.token(), std::move(typed));
  CLI::App app("3D emission fields of flames from a ring of cameras", name);
  app.set_version_flag("--version", concat(name, " ", program_version()));
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "Help of all commands");
  if (ranks) {
    add_reconstruct_on(*ranks, app, session);
  } else {
    for (const auto& add : kCommands) add(app, session);
  }
  return parse_and_run(app, session, ranks, argc, argv);
}

}  // namespace

int run_command_line(int argc, char** argv) {
  return run_program("flamefield", nullptr, argc, argv);
}

int run_command_line_on(Ranks& ranks, int argc, char** argv) {
  return run_program("flamefield-mpi", &ranks, argc, argv);
}

double peak_rss_mib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace flamefield
