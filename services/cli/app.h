#pragma once

#include <cstdio>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>

#include "proto/error.h"

namespace flamefield {

enum class ExitCode {
  Done = 0,
  Failed = 1,  // the work failed: a damaged file, no space, a stop
  Usage = 2,   // the command line or a configuration file is at fault
};

// How a command ends early. Caught only in run_command_line.
struct CommandFailure {
  ExitCode code;
  std::string message;  // "<problem> (<why>) <suggestion>"
};

// The value, or the end of the command with exit code 1, or with 2 for what the user typed or configured.
template <class T>
T or_fail(Result<T> result, ExitCode code = ExitCode::Failed) {
  if (!result) throw CommandFailure{code, result.error().message};
  if constexpr (!std::is_void_v<T>) return std::move(*result);
}
template <class T>
T or_usage(Result<T> result) {
  return or_fail(std::move(result), ExitCode::Usage);
}
// The same, with the file at fault in front of a message that does not name it.
template <class T>
T or_fail_about(const std::filesystem::path& path, Result<T> result) {
  if (!result) result.error().message = concat(path.string(), ": ", result.error().message);
  return or_fail(std::move(result));
}

// What every command shares: the chosen work, and how to stop it.
class Session {
 public:
  Session(std::stop_token stop, std::string command_line)
      : stop_(std::move(stop)), command_line_(std::move(command_line)) {}
  void choose(std::function<void()> work) { work_ = std::move(work); }
  void run() const { work_(); }
  const std::stop_token& stop() const { return stop_; }
  const std::string& command_line() const { return command_line_; }  // as it was typed
  // Ends the command when Ctrl-C was pressed. To be called between steps and before results are written.
  void check_stop() const;

 private:
  std::stop_token stop_;
  std::string command_line_;
  std::function<void()> work_;
};

// The whole program: parses, runs, reports. Ctrl-C and SIGTERM request a stop; a second one ends at once.
int run_command_line(int argc, char** argv);

// The most memory that this process ever held.
double peak_rss_mib();

}  // namespace flamefield
