#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "proto/job.h"

namespace flamefield {

// A job that waits, as far as it matters for its turn.
struct WaitingJob {
  std::int64_t id = 0;
  Priority priority = Priority::Interactive;
  std::string share = {};       // whose share of the workers it uses: a submitter, or a capture
  std::int64_t not_before = 0;  // back-off, on the caller's clock
  bool paused = false;
  double cost_s = 1;          // estimated, > 0: what it takes from its share
  std::int64_t need_mib = 0;  // estimated memory; 0: unknown
  std::string tied_to = {};   // worker that it killed before: while that one is there, no other gets it
};

// Whom a job may be given to.
struct Candidate {
  std::string name;
  std::int64_t memory_mib = 0;  // 0: not told, takes everything
  bool live_only = false;
};

// Decides whose turn it is; knows neither sockets nor tables. Live before interactive before scheduled. Live
// jobs go newest first, so that the page follows the flame when workers do not, and the older ones are done
// once there is time. Within the other priorities shares are served in turn, weighed by cost (start-time fair
// queueing: Goyal, Vin, Cheng, 1996), and within a share oldest first. Jobs that killed a worker come after
// all others of their priority.
class JobQueue {
 public:
  void add(WaitingJob job);      // replaces one of the same id
  void remove(std::int64_t id);  // unknown: nothing happens
  void pause(std::int64_t id, bool paused);
  void pause_all(bool paused) { paused_all_ = paused; }
  void clear();  // waiting jobs; what shares were given is remembered

  // Takes the next job for `worker` out; none when nothing suits it. `workers`: all that are connected.
  std::optional<WaitingJob> take(const Candidate& worker, std::span<const Candidate> workers,
                                 std::int64_t now);

  // Why a waiting job waits, for people; `none` are connected when `workers` is empty. The end of a back-off
  // is not named, since the clock is the caller's: see back_off_end().
  std::string why(std::int64_t id, std::span<const Candidate> workers, std::int64_t now) const;
  std::optional<std::int64_t> back_off_end(std::int64_t id, std::int64_t now) const;

  std::int64_t size() const { return static_cast<std::int64_t>(jobs_.size()); }
  std::int64_t size(Priority priority) const { return static_cast<std::int64_t>(all_of(priority).size()); }
  // May there be jobs that killed a worker? Only these need to know who is connected.
  bool has_suspects() const {
    return !later_.empty() ||
           std::any_of(classes_.begin(), classes_.end(), [](const Class& c) { return !c.suspects.empty(); });
  }
  bool paused_all() const { return paused_all_; }
  // The first ids by priority, live newest first, else oldest first (shares are not told apart).
  std::vector<std::int64_t> first(std::int64_t limit) const;

 private:
  // The jobs of one share that may be given out, by the memory that they need.
  struct Line {
    std::map<std::int64_t, std::set<std::int64_t>> by_need;
    double served_s = 0;  // virtual time: what the share was given
  };
  struct Class {
    std::map<std::string, Line> lines;
    std::set<std::int64_t> all;       // waiting, for whatever reason
    std::set<std::int64_t> suspects;  // tied to a worker
    double floor_s = 0;               // virtual time of the last service: where newcomers begin
  };

  const std::set<std::int64_t>& all_of(Priority p) const { return classes_[static_cast<std::size_t>(p)].all; }
  Class& class_of(const WaitingJob& job) { return classes_[static_cast<std::size_t>(job.priority)]; }
  std::int64_t ahead_of(const WaitingJob& job) const;
  void enter(const WaitingJob& job);
  void leave(const WaitingJob& job);
  void end_back_offs(std::int64_t now);
  static std::optional<std::int64_t> newest(const Class& c, std::int64_t memory_mib);
  static std::optional<std::int64_t> fairest(Class& c, std::int64_t memory_mib);
  std::optional<std::int64_t> suspect(const Class& c, const Candidate& worker,
                                      std::span<const Candidate> workers) const;

  std::map<std::int64_t, WaitingJob> jobs_;
  std::array<Class, 3> classes_;                           // by priority
  std::set<std::pair<std::int64_t, std::int64_t>> later_;  // (not before, id)
  bool paused_all_ = false;
};

}  // namespace flamefield
