#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "proto/message.h"
#include "services/dispatcher/job_queue.h"

namespace flamefield {

// Who works on what, as far as this dispatcher's life goes. Deadlines are on the steady clock: setting the
// machine's time does not end leases. Not thread-safe.
class Roster {
 public:
  using Clock = std::chrono::steady_clock;

  // One credit: this worker takes a job. `in_process`: it is a thread of our own process.
  void ready(const std::string& peer, const Ready& worker, bool in_process, Clock::time_point now);
  void seen(const std::string& peer, Clock::time_point now);
  void gone(const std::string& peer);

  const std::string& name_of(const std::string& peer) const;
  bool is_in_process(const std::string& peer) const;

  // Peers with a credit, the longest waiting first.
  std::vector<std::string> idle() const;
  // All that are connected, with the memory of their machines; and one of them, with what of it the jobs that
  // run there are expected to leave.
  std::vector<Candidate> candidates() const;
  Candidate candidate(const std::string& peer) const;

  // Takes the credit.
  void lease(const std::string& peer, std::int64_t token, std::int64_t job_id, std::int64_t need_mib,
             Clock::time_point deadline);
  bool extend(std::int64_t token, Clock::time_point deadline);  // false: no such lease
  void end(std::int64_t token);
  std::vector<std::int64_t> expired(Clock::time_point now) const;  // tokens
  std::optional<std::string> holder_of(std::int64_t token) const;  // peer

  // Forgets idle workers that were silent since `limit`, and all leases when the ledger voided them.
  void drop_silent(Clock::time_point limit);
  void void_leases();

  bool has_idle() const { return !idle_.empty(); }
  std::vector<Status::Worker> status(Clock::time_point now) const;

 private:
  struct Worker {
    Ready told;
    bool in_process = false;
    std::uint64_t credit = 0;  // its place in idle_; 0: none
    std::int64_t token = 0;    // 0: none
    std::int64_t job_id = 0;
    std::int64_t need_mib = 0;  // of that job
    Clock::time_point last_seen;
  };
  // Whose memory it is: the host's, or the worker's own.
  static std::string memory_of(const Worker& worker) {
    return worker.told.own_memory ? "worker " + worker.told.worker : "host " + worker.told.host;
  }
  struct Held {
    std::string peer;
    Clock::time_point deadline;
  };
  void spend_credit(Worker& worker);
  void reserve(Worker& worker, std::int64_t need_mib);

  // A thousand workers say thousands of things a second: nothing here walks over all of them for one.
  std::map<std::string, Worker> workers_;      // by peer
  std::map<std::uint64_t, std::string> idle_;  // peers with a credit, in the order in which they got it
  std::uint64_t credits_ = 0;
  std::map<std::string, std::int64_t> reserved_mib_;  // by memory: what the jobs there are expected to need
  std::map<std::int64_t, Held> leases_;
  std::set<std::pair<Clock::time_point, std::int64_t>> deadlines_;  // of leases_
};

}  // namespace flamefield
