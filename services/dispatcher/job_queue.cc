#include "services/dispatcher/job_queue.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>

#include "proto/check.h"
#include "proto/error.h"

namespace flamefield {

namespace {

constexpr std::int64_t kMostCounted = 1000;

std::int64_t room_of(const Candidate& worker) {
  return worker.memory_mib > 0 ? worker.memory_mib : std::numeric_limits<std::int64_t>::max();
}

bool is_among(std::span<const Candidate> workers, const std::string& name) {
  return std::ranges::any_of(workers, [&](const Candidate& worker) { return worker.name == name; });
}

std::string gib(std::int64_t mib) {
  return concat(std::round(static_cast<double>(mib) / 102.4) / 10, " GiB");
}

}  // namespace

void JobQueue::add(WaitingJob job) {
  expect(job.cost_s > 0, "a job costs something");
  remove(job.id);
  class_of(job).all.insert(job.id);
  enter(jobs_[job.id] = std::move(job));
}

void JobQueue::remove(std::int64_t id) {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return;
  leave(found->second);
  class_of(found->second).all.erase(id);
  jobs_.erase(found);
}

void JobQueue::pause(std::int64_t id, bool paused) {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return;
  leave(found->second);
  found->second.paused = paused;
  enter(found->second);
}

void JobQueue::clear() {
  jobs_.clear();
  later_.clear();
  for (Class& c : classes_) {
    c.all.clear();
    c.suspects.clear();
    for (auto& [share, line] : c.lines) line.by_need.clear();
  }
}

// Into the one place where it waits: nowhere (paused), later_, suspects, or a line.
void JobQueue::enter(const WaitingJob& job) {
  if (job.paused) return;
  if (job.not_before > 0) {
    later_.insert({job.not_before, job.id});
    return;
  }
  Class& c = class_of(job);
  if (!job.tied_to.empty()) {
    c.suspects.insert(job.id);
    return;
  }
  Line& line = c.lines[job.share];
  // Who was away has not saved anything up.
  if (line.by_need.empty()) line.served_s = std::max(line.served_s, c.floor_s);
  line.by_need[job.need_mib].insert(job.id);
}

void JobQueue::leave(const WaitingJob& job) {
  later_.erase({job.not_before, job.id});
  Class& c = class_of(job);
  c.suspects.erase(job.id);
  const auto line = c.lines.find(job.share);
  if (line == c.lines.end()) return;
  const auto need = line->second.by_need.find(job.need_mib);
  if (need == line->second.by_need.end()) return;
  need->second.erase(job.id);
  if (need->second.empty()) line->second.by_need.erase(need);
  // A share with nothing to do and nothing on its account is like a new one.
  if (line->second.by_need.empty() && line->second.served_s <= c.floor_s) c.lines.erase(line);
}

void JobQueue::end_back_offs(std::int64_t now) {
  while (!later_.empty() && later_.begin()->first <= now) {
    WaitingJob& job = jobs_.at(later_.begin()->second);
    leave(job);
    job.not_before = 0;
    enter(job);
  }
}

std::optional<std::int64_t> JobQueue::newest(const Class& c, std::int64_t memory_mib) {
  std::optional<std::int64_t> best;
  for (const auto& [share, line] : c.lines) {
    for (const auto& [need, ids] : line.by_need) {
      if (need > memory_mib) break;
      best = std::max(best, std::optional(*ids.rbegin()));
    }
  }
  return best;
}

std::optional<std::int64_t> JobQueue::fairest(Class& c, std::int64_t memory_mib) {
  const Line* least_served = nullptr;
  for (const auto& [share, line] : c.lines) {
    if (line.by_need.empty() || line.by_need.begin()->first > memory_mib) continue;
    if (!least_served || line.served_s < least_served->served_s) least_served = &line;
  }
  if (!least_served) return std::nullopt;
  std::int64_t oldest = std::numeric_limits<std::int64_t>::max();
  for (const auto& [need, ids] : least_served->by_need) {
    if (need > memory_mib) break;
    oldest = std::min(oldest, *ids.begin());
  }
  return oldest;
}

std::optional<std::int64_t> JobQueue::suspect(const Class& c, const Candidate& worker,
                                              std::span<const Candidate> workers) const {
  for (const std::int64_t id : c.suspects) {
    const WaitingJob& job = jobs_.at(id);
    if (job.need_mib > room_of(worker)) continue;
    if (job.tied_to == worker.name || !is_among(workers, job.tied_to)) return id;
  }
  return std::nullopt;
}

std::optional<WaitingJob> JobQueue::take(const Candidate& worker, std::span<const Candidate> workers,
                                         std::int64_t now) {
  end_back_offs(now);
  if (paused_all_) return std::nullopt;
  for (const Priority priority : {Priority::Live, Priority::Interactive, Priority::Scheduled}) {
    if (worker.live_only && priority != Priority::Live) break;
    Class& c = classes_[static_cast<std::size_t>(priority)];
    auto id = priority == Priority::Live ? newest(c, room_of(worker)) : fairest(c, room_of(worker));
    if (id) {
      Line& line = c.lines.at(jobs_.at(*id).share);
      c.floor_s = std::max(c.floor_s, line.served_s);
      line.served_s += jobs_.at(*id).cost_s;
    } else {
      id = suspect(c, worker, workers);
    }
    if (!id) continue;
    WaitingJob job = jobs_.at(*id);
    remove(*id);
    return job;
  }
  return std::nullopt;
}

std::optional<std::int64_t> JobQueue::back_off_end(std::int64_t id, std::int64_t now) const {
  const auto found = jobs_.find(id);
  if (found == jobs_.end() || found->second.not_before <= now) return std::nullopt;
  return found->second.not_before;
}

std::string JobQueue::why(std::int64_t id, std::span<const Candidate> workers, std::int64_t now) const {
  const auto found = jobs_.find(id);
  if (found == jobs_.end()) return "not waiting";
  const WaitingJob& job = found->second;
  if (job.paused) return "paused";
  if (paused_all_) return "paused with all others";
  if (job.not_before > now) return "back-off";
  if (workers.empty()) return "no worker connected";
  if (job.priority != Priority::Live &&
      std::ranges::all_of(workers, [](const Candidate& worker) { return worker.live_only; }))
    return "no worker connected but those for live work";
  const std::int64_t largest = room_of(*std::ranges::max_element(workers, {}, room_of));
  if (job.need_mib > largest)
    return concat("needs ", gib(job.need_mib), ", largest worker has ", gib(largest));
  if (!job.tied_to.empty() && is_among(workers, job.tied_to))
    return concat("it killed worker ", job.tied_to, ", which alone may try again");
  for (const Priority before : {Priority::Live, Priority::Interactive}) {
    if (before > job.priority && size(before) > 0)
      return concat("behind ", size(before), ' ', name_of(before), " job", size(before) == 1 ? "" : "s");
  }
  const std::int64_t ahead = ahead_of(job);
  if (ahead == 0) return "next in line, all workers are busy";
  return concat("behind ", ahead > kMostCounted ? "more than " : "", std::min(ahead, kMostCounted), ' ',
                name_of(job.priority), " job", ahead == 1 ? "" : "s");
}

std::int64_t JobQueue::ahead_of(const WaitingJob& job) const {
  const auto count = [&](auto&& ids) {
    std::int64_t ahead = 0;
    for (auto it = ids.begin(); *it != job.id && ahead <= kMostCounted; ++it) ++ahead;
    return ahead;
  };
  const auto& all = all_of(job.priority);
  return job.priority == Priority::Live ? count(std::views::reverse(all)) : count(all);
}

std::vector<std::int64_t> JobQueue::first(std::int64_t limit) const {
  std::vector<std::int64_t> ids;
  const auto append = [&](std::ranges::input_range auto&& from) {
    for (const std::int64_t id : from) {
      if (std::ssize(ids) == limit) return;
      ids.push_back(id);
    }
  };
  append(std::views::reverse(all_of(Priority::Live)));
  append(all_of(Priority::Interactive));
  append(all_of(Priority::Scheduled));
  return ids;
}

}  // namespace flamefield
