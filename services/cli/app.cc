#include "services/cli/app.h"

#include <pthread.h>
#include <signal.h>
#include <sys/resource.h>
#include <time.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <array>
#include <chrono>
#include <iostream>
#include <thread>

#include "proto/check.h"
#include "proto/version.h"
#include "services/cli/commands.h"
#include "services/config/suggestion.h"

namespace flamefield {

namespace {

// One row a command, in the order of the help.
constexpr std::array kCommands = {&add_phantom,  &add_ring, &add_render,  &add_prepare,  &add_reconstruct,
                                  &add_evaluate, &add_show, &add_convert, &add_calibrate};

// Turns SIGINT and SIGTERM into a stop request. Threads started later inherit the blocked mask, so that the
// watcher alone receives them.
class SignalWatcher {
 public:
  SignalWatcher() {
    ::sigemptyset(&signals_);
    ::sigaddset(&signals_, SIGINT);
    ::sigaddset(&signals_, SIGTERM);
    ::pthread_sigmask(SIG_BLOCK, &signals_, nullptr);
    ::signal(SIGXFSZ, SIG_IGN);  // a full quota is an error of write(), not the end of the process
    ::signal(SIGPIPE, SIG_IGN);
    thread_ = std::jthread([this](const std::stop_token& end) { watch(end); });
  }
  std::stop_token token() const { return source_.get_token(); }

 private:
  void watch(const std::stop_token& end) {
    auto first = Clock::now();
    while (!end.stop_requested()) {
      const timespec poll{0, 100'000'000};
      const int signal = ::sigtimedwait(&signals_, nullptr, &poll);
      if (signal < 0) continue;
      if (!source_.stop_requested()) first = Clock::now();
      // Shells and wrappers may deliver one Ctrl-C twice.
      if (source_.stop_requested() && Clock::now() - first > std::chrono::milliseconds(500))
        ::_exit(static_cast<int>(ExitCode::Failed));
      source_.request_stop();
    }
  }

  using Clock = std::chrono::steady_clock;
  sigset_t signals_{};
  std::stop_source source_;
  std::jthread thread_;
};

int report(ExitCode code, const std::string& message) {
  std::cerr << "flamefield: " << message << '\n';
  return static_cast<int>(code);
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

int parse_and_run(CLI::App& app, Session& session, int argc, char** argv) {
  try {
    check_command_name(app, argc, argv);
    app.parse(argc, argv);
    session.run();
    std::cout.flush();
    return static_cast<int>(ExitCode::Done);
  } catch (const CLI::Success& help_or_version) {
    return app.exit(help_or_version);
  } catch (const CLI::ParseError& error) {
    return report(ExitCode::Usage, concat(error.what(), " (the command line does not fit) see '",
                                          full_name(chosen_command(app)), " --help'"));
  } catch (const CommandFailure& failure) {
    return report(failure.code, failure.message);
  } catch (const std::bad_alloc&) {
    return report(ExitCode::Failed, "out of memory (the data do not fit) use a smaller grid");
  } catch (const ContractViolation& violation) {
    return report(ExitCode::Failed, concat("internal fault (", violation.what(), ") please report it"));
  } catch (const std::exception& exception) {
    return report(ExitCode::Failed, concat("unexpected failure (", exception.what(), ") please report it"));
  }
}

}  // namespace

void Session::check_stop() const {
  if (stop_.stop_requested())
    throw CommandFailure{ExitCode::Failed, "stopped (on request) nothing was written"};
}

int run_command_line(int argc, char** argv) {
  const SignalWatcher watcher;
  Session session(watcher.token());
  CLI::App app("3D emission fields of flames from a ring of cameras", "flamefield");
  app.set_version_flag("--version", concat("flamefield ", program_version()));
  app.require_subcommand(1);
  app.set_help_all_flag("--help-all", "Help of all commands");
  for (const auto& add : kCommands) add(app, session);
  return parse_and_run(app, session, argc, argv);
}

double peak_rss_mib() {
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

}  // namespace flamefield
