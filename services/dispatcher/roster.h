#pragma once

#include <chrono>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "proto/message.h"

namespace flamefield {

// Who works on what, as far as this dispatcher's life goes. Deadlines are on the steady clock: setting the
// machine's time does not end leases. Not thread-safe.
class Roster {
 public:
  using Clock = std::chrono::steady_clock;

  void ready(const std::string& peer, const std::string& name, Clock::time_point now);
  void seen(const std::string& peer, Clock::time_point now);
  void gone(const std::string& peer);

  // The idle worker that has waited longest; it is not idle any more.
  std::optional<std::string> take_idle();
  const std::string& name_of(const std::string& peer) const;

  void lease(const std::string& peer, std::int64_t token, std::int64_t job_id, Clock::time_point deadline);
  bool extend(std::int64_t token, Clock::time_point deadline);  // false: no such lease
  void end(std::int64_t token);
  std::vector<std::int64_t> expired(Clock::time_point now) const;  // tokens
  std::optional<std::string> holder_of(std::int64_t token) const;  // name

  // Forgets idle workers that were silent since `limit`, and all leases when the ledger voided them.
  void drop_silent(Clock::time_point limit);
  void void_leases();

  bool has_workers() const { return !workers_.empty(); }
  bool has_idle() const { return !idle_.empty(); }
  std::vector<Status::Worker> status(Clock::time_point now) const;

 private:
  struct Worker {
    std::string name;
    std::int64_t token = 0;  // 0: none
    std::int64_t job_id = 0;
    Clock::time_point last_seen;
  };
  struct Held {
    std::string peer;
    Clock::time_point deadline;
  };
  std::map<std::string, Worker> workers_;  // by peer
  std::deque<std::string> idle_;
  std::map<std::int64_t, Held> leases_;
};

}  // namespace flamefield
