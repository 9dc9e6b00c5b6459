#pragma once

#include <functional>

#include "proto/error.h"
#include "services/process/supervisor.h"

namespace CLI {
class App;
}

namespace flamefield {

// What every daemon's main does: parse, serve until the end, report. Exit code 0: served and stopped; 1: the
// work failed; 2: usage or configuration (InvalidInput).
int run_daemon(CLI::App& app, int argc, char** argv, const std::function<Result<>()>& serve);

// The same in a child process that is started again when a signal kills it, see supervise().
int run_supervised_daemon(CLI::App& app, int argc, char** argv, const std::function<Result<>(Life&)>& serve);

}  // namespace flamefield
