#pragma once

#include <chrono>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

struct ProgramOutput {
  int exit_code = 0;  // 128 + signal when it was killed
  std::string out, err;
};

// Runs another program of PATH to its end, without a shell and with nothing on its standard input. NotFound:
// there is none of this name. Unavailable: it did not end in time (it is killed), or said more than 1 GiB.
Result<ProgramOutput> run_program(const std::vector<std::string>& command, std::chrono::milliseconds timeout);

}  // namespace flamefield
