#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace flamefield::testing_support {

// One of our programs as a process; killed when the test is over.
class Process {
 public:
  Process(const std::string& program, const std::vector<std::string>& arguments,
          const std::filesystem::path& log);
  Process(Process&& other) noexcept;
  Process& operator=(Process&& other) noexcept;
  ~Process();
  void signal(int number) const;
  int wait();  // exit status; 128 + signal when killed

 private:
  int pid_ = 0;
};

struct ChaosOptions {
  int sets = 60;
  int kills = 20;
  int workers = 2;
};

// A capture is sent while dispatcher and workers are killed with -9 at random moments. Expects: every set
// stored, every volume made, nothing committed twice, receipts that balance, volumes that can be read.
void expect_survival(const ChaosOptions& options);

}  // namespace flamefield::testing_support
