#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/job.h"
#include "services/bus/bus.h"

namespace flamefield {

// What a job sees of the world. Called on the worker's job thread.
struct JobContext {
  const Lease& lease;
  std::string worker;
  std::function<Result<std::vector<FrameSet>>(std::span<const SetId>)> fetch;  // with pixels
  std::function<void(const Progress&)> progress;  // cheap; token and run id are filled in
  std::stop_token stop;                           // the lease is lost, or the worker stops
};

// Makes the run's files under staged_path(run.volume_path, token) and returns its record. Unavailable errors
// are tried again by some worker, others are final.
using JobStep = std::function<Result<Run>(const JobContext&)>;

struct WorkerOptions {
  std::string endpoint = "inproc://dispatcher";
  std::string name;  // empty: made from host and process
  std::filesystem::path data_dir;
  int threads = 0;                             // told to the dispatcher
  std::int64_t memory_mib = 0;                 // that jobs may use; 0: what the machine has
  std::chrono::milliseconds heartbeat{1'000};  // well below a third of the lease
  std::chrono::milliseconds patience{30'000};  // for answers of the dispatcher
  bool own_memory = false;                     // memory_mib is not shared with other workers of this host
  bool live_only = false;                      // takes live work alone
  // A worker that was hired for a time, e.g. as a job of a cluster, goes home by itself. 0: it stays.
  std::chrono::seconds idle_limit{0};     // without a job for so long
  std::chrono::seconds silence_limit{0};  // without a word of the dispatcher for so long: an error
};

// A job that the worker's process died of the last time, told by whoever watched it.
struct LostLife {
  std::int64_t token = 0;  // 0: none
  std::string reason;      // e.g. "killed by signal 11 (Segmentation fault)"
};

// Pulls one job at a time and keeps its lease alive while the step works on it.
class Worker {
 public:
  Worker(Bus& bus, const WorkerOptions& options, JobStep step);

  // Where the token of the job in hand is noted (0: none), for whoever watches this process; outlives the
  // worker. And what became of the process before this one: the dispatcher hears of it first.
  void watched_by(std::atomic<std::int64_t>& in_hand, LostLife last) {
    in_hand_ = &in_hand;
    lost_ = std::move(last);
  }

  // Until asked to stop; then the job at hand is given back at once. Asked to drain, it finishes that job and
  // takes no other. An error only when the dispatcher refuses this worker (another version, other volumes,
  // its key revoked), is silent for too long, or the endpoint is malformed.
  Result<> run(std::stop_token stop, std::stop_token drain = {});

 private:
  class Session;
  Bus& bus_;
  WorkerOptions options_;
  JobStep step_;
  std::atomic<std::int64_t> unwatched_{0};
  std::atomic<std::int64_t>* in_hand_ = &unwatched_;
  LostLife lost_;
};

}  // namespace flamefield
