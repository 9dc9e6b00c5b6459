#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/error.h"
#include "services/bus/bus.h"

namespace flamefield {

struct DispatcherOptions {
  std::filesystem::path data_dir;  // holds ledger.sqlite, ledger.lock, spool/, volumes/
  std::vector<std::string> endpoints = {"inproc://dispatcher"};
  std::vector<std::string> event_endpoints = {"inproc://events"};
  std::chrono::milliseconds lease{10'000};    // a worker silent for longer has lost its job
  std::chrono::milliseconds back_off{1'000};  // before the second attempt; doubles with each further one
  int max_attempts = 10;                      // then the job has failed
  int max_batch = 256;                        // messages per group commit
  std::uint64_t segment_bytes = 256u << 20;   // of the spool
};

// Takes frame sets in (durable before acknowledged) and hands work out (leases; committed exactly once).
// Owns the ledger and the spool of its data directory. After a crash it starts where the ledger stands:
// every lease void, no acknowledged set lost.
class Dispatcher {
 public:
  // Unavailable: ledger locked, endpoint in use, disk full. `bus` outlives the dispatcher.
  static Result<std::unique_ptr<Dispatcher>> open(Bus& bus, const DispatcherOptions& options);
  ~Dispatcher();

  // Serves until asked to stop (then returns within 0.1 s) or until the ledger fails.
  Result<> run(std::stop_token stop);

  // Endpoints as bound, e.g. with the port that "tcp://127.0.0.1:*" became.
  const std::vector<std::string>& endpoints() const;
  const std::vector<std::string>& event_endpoints() const;

 private:
  struct Impl;
  explicit Dispatcher(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace flamefield
