#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "services/selftest/child_process.h"
#include "tests/support/scratch.h"

namespace flamefield::testing_support {

// Slurm on this host alone: munged, slurmctld and two slurmd on loopback, as root, from Debian's packages,
// each of which may be killed and started again. Ports and files are its own; nothing is left behind.
class SlurmCluster {
 public:
  // Why there can be none here; empty: there can.
  static std::string missing();

  SlurmCluster();  // sets SLURM_CONF; is_up() is false when it did not come up
  ~SlurmCluster();
  SlurmCluster(const SlurmCluster&) = delete;

  bool is_up();
  void kill(const std::string& daemon);  // -9: "slurmctld", "w1", "w2"
  void start(const std::string& daemon);
  std::string logs() const;

 private:
  void write_configuration();
  std::filesystem::path file(const std::string& name) const { return scratch_ / name; }

  Scratch scratch_;
  int first_port_ = 0;
  std::map<std::string, ChildProcess> daemons_;
};

// Ends, with -9, every process whose command line holds all of these words; how many there were.
int kill_processes(std::initializer_list<std::string> words);

}  // namespace flamefield::testing_support
