#include "services/process/daemon.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "proto/version.h"
#include "services/log/log.h"

namespace flamefield {

namespace {

// Parses, then `live`s: an exit code.
int parse_and_run(CLI::App& app, int argc, char** argv, const std::function<int()>& live) {
  app.set_version_flag("--version", concat(app.get_name(), " ", program_version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  return live();
}

int report_end(const std::string& program, const std::function<Result<>()>& serve) {
  try {
    const auto end = serve();
    if (end) {
      log_event(LogLevel::Info, "stopped", {{"program", program}});
      return 0;
    }
    std::cerr << program << ": " << end.error().message << '\n';
    return end.error().code == ErrorCode::InvalidInput ? 2 : 1;
  } catch (const std::exception& defect) {
    std::cerr << program << ": internal fault (" << defect.what() << ") please report it\n";
    return 1;
  }
}

}  // namespace

int run_daemon(CLI::App& app, int argc, char** argv, const std::function<Result<>()>& serve) {
  return parse_and_run(app, argc, argv, [&] { return report_end(app.get_name(), serve); });
}

int run_supervised_daemon(CLI::App& app, int argc, char** argv, const std::function<Result<>(Life&)>& serve) {
  return parse_and_run(app, argc, argv, [&] {
    return supervise([&](Life& life) { return report_end(app.get_name(), [&] { return serve(life); }); });
  });
}

}  // namespace flamefield
