#include "services/process/daemon.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "proto/version.h"
#include "services/log/log.h"

namespace flamefield {

int run_daemon(CLI::App& app, int argc, char** argv, const std::function<Result<>()>& serve) {
  app.set_version_flag("--version", concat(app.get_name(), " ", program_version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  try {
    const auto end = serve();
    if (end) {
      log_event(LogLevel::Info, "stopped", {{"program", app.get_name()}});
      return 0;
    }
    std::cerr << app.get_name() << ": " << end.error().message << '\n';
    return end.error().code == ErrorCode::InvalidInput ? 2 : 1;
  } catch (const std::exception& defect) {
    std::cerr << app.get_name() << ": internal fault (" << defect.what() << ") please report it\n";
    return 1;
  }
}

}  // namespace flamefield
