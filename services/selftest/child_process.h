#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// Another program as a process in a group of its own; killed, with all that it started, when this goes.
class ChildProcess {
 public:
  // Its standard error is appended to `log`. NotFound: no such program.
  static Result<ChildProcess> start(const std::filesystem::path& program,
                                    const std::vector<std::string>& arguments,
                                    const std::filesystem::path& log);
  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  ~ChildProcess();

  void signal(int number) const;        // to the process itself
  void signal_group(int number) const;  // and all that it started: what -9, STOP and CONT are for
  int wait();                           // exit status; 128 + signal when killed
  int pid() const { return pid_; }

 private:
  explicit ChildProcess(int pid) : pid_(pid) {}
  int pid_ = 0;
};

}  // namespace flamefield
