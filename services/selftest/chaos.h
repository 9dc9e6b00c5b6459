#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/error.h"

namespace flamefield {

struct ChaosOptions {
  int sets = 300;
  double rate_hz = 15;
  int dispatcher_kills = 3;  // with -9, at random moments
  int worker_kills = 10;     // likewise
  int cuts = 6;              // of all connections at once
  int freezes = 1;           // a worker is stopped for longer than its lease, and goes on
  int workers = 2;
  int iterations = 1000;  // of the solver: a job long enough to be killed in
  unsigned seed = 1;
  std::filesystem::path programs = {};   // holds flamefield-dispatchd and flamefield-worker
  std::filesystem::path directory = {};  // empty, for this run
};

struct ChaosResult {
  int sets = 0;             // offered
  int lost = 0;             // of these, without a volume in the end
  int committed_twice = 0;  // volumes
  int dispatcher_kills = 0, worker_kills = 0, cuts = 0, freezes = 0;
  bool balances = false;        // every receipt
  std::int64_t sent_again = 0;  // sets, for want of an acknowledgement
  double wall_s = 0;
  std::vector<std::string> problems;  // what was wrong, one a line
  bool survived() const { return lost == 0 && committed_twice == 0 && balances && problems.empty(); }
};

// A capture goes on over real sockets while the real programs die: every set must be stored, become exactly
// one readable volume, and be accounted for. `progress` hears how many sets were offered and volumes made.
// Unavailable: programs cannot be started, or nothing moves any more; stopped.
Result<ChaosResult> run_chaos(const ChaosOptions& options, std::stop_token stop,
                              const std::function<void(int offered)>& progress);

}  // namespace flamefield
