#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// Slurm as its own programs show it: sbatch, squeue, scancel, sinfo, as child processes. libslurm is GPL and
// its ABI changes with every release, so it is never linked.

// A job, or one of an array.
struct SlurmJob {
  std::int64_t id = 0;  // a hint: a controller that lost its state gives the same one out again
  int task = 0;         // of the array
  std::string tasks;    // of an array that was not split up yet, e.g. "3-16"
  std::string name;     // ours, and the truth
  std::string state;    // PENDING, RUNNING, COMPLETING, COMPLETED, FAILED, TIMEOUT, CANCELLED, ...
  std::string reason;   // that Slurm gives for the state: Priority, Resources, PartitionDown, ...
  std::string description;
  std::string partition, nodes;
  std::int64_t start_time_s = 0, time_limit_min = 0;  // UTC; 0: not known, none

  bool is_pending() const { return state == "PENDING"; }
  // Still has, or will have, processes.
  bool is_alive() const;
};

// What `squeue --json` wrote; understands 22.05 and the later form of numbers and states. InvalidInput: it is
// none. Unavailable: the controller did not answer.
Result<std::vector<SlurmJob>> read_squeue(std::string_view json);

// Why a job of Slurm waits, or ended, in words.
std::string explain(const SlurmJob& job);

// An array of pilots.
struct PilotArray {
  std::string name;
  std::filesystem::path script, directory;  // logs go to directory/pilot-TASK.log
  std::vector<std::string> arguments;       // of the script
  int pilots = 1, cores = 1, drain_s = 120;
  std::int64_t memory_mib = 1024;
  int minutes = 0;                             // 0: as long as the partition lets it
  std::string partition, account, constraint;  // empty: Slurm's default, none
  std::vector<std::string> sbatch;             // further arguments
};
std::vector<std::string> sbatch_command(const PilotArray& array);

// Submits. A controller that does not answer is asked for a minute; whether an attempt was accepted all the
// same is found out by name, so that nothing is submitted twice. The answer is Slurm's id of the array.
// NotFound: no sbatch. InvalidInput: refused (account, partition, size), in Slurm's own words.
Result<std::int64_t> submit(const PilotArray& array);

// All jobs of this name that Slurm still knows, those that ended lately included.
Result<std::vector<SlurmJob>> jobs_named(const std::string& name);
// Of all names that begin so.
Result<std::vector<SlurmJob>> jobs_named_like(const std::string& prefix);

enum class Cancel { Waiting, Drain, Now };
Result<> cancel(const std::string& name, Cancel how);

// What is known about a partition: "up", "down", "drain", "inact". NotFound: there is none. Empty: the
// default.
Result<std::string> partition_state(const std::string& partition);

}  // namespace flamefield
