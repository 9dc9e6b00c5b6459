#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "services/selftest/chaos.h"
#include "services/selftest/child_process.h"

namespace flamefield::testing_support {

// One of our programs (or, by its absolute path, another one) as a process; killed when the test is over.
class Process {
 public:
  Process(const std::string& program, const std::vector<std::string>& arguments,
          const std::filesystem::path& log);
  void signal(int number) const { child_.signal(number); }
  int pid() const { return child_.pid(); }
  int wait() { return child_.wait(); }  // exit status; 128 + signal when killed

 private:
  ChildProcess child_;
};

// Expects: every set stored, every volume made, nothing committed twice, receipts that balance, volumes that
// can be read. Programs and folder are filled in; the seed is printed.
void expect_survival(ChaosOptions options);

}  // namespace flamefield::testing_support
