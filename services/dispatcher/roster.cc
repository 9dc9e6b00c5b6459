#include "services/dispatcher/roster.h"

#include <algorithm>

namespace flamefield {

void Roster::ready(const std::string& peer, const Ready& worker, bool in_process, Clock::time_point now) {
  Worker& known = workers_[peer];
  const std::int64_t need_mib = known.need_mib;
  reserve(known, 0);
  known.told = worker;
  reserve(known, need_mib);
  known.in_process = in_process;
  known.last_seen = now;
  // A Ready that crossed its Lease on the way is no second credit.
  if (known.token != 0 || known.credit != 0) return;
  known.credit = ++credits_;
  idle_[known.credit] = peer;
}

void Roster::spend_credit(Worker& worker) {
  idle_.erase(worker.credit);
  worker.credit = 0;
}

// What a worker's job is expected to need; 0: it has none.
void Roster::reserve(Worker& worker, std::int64_t need_mib) {
  if (need_mib == worker.need_mib) return;
  const auto memory = reserved_mib_.try_emplace(memory_of(worker)).first;
  memory->second += need_mib - worker.need_mib;
  if (memory->second == 0) reserved_mib_.erase(memory);
  worker.need_mib = need_mib;
}

void Roster::seen(const std::string& peer, Clock::time_point now) {
  if (const auto found = workers_.find(peer); found != workers_.end()) found->second.last_seen = now;
}

void Roster::gone(const std::string& peer) {
  const auto found = workers_.find(peer);
  if (found == workers_.end()) return;
  spend_credit(found->second);
  reserve(found->second, 0);
  workers_.erase(found);
}

std::vector<std::string> Roster::idle() const {
  std::vector<std::string> peers;
  for (const auto& [credit, peer] : idle_) peers.push_back(peer);
  return peers;
}

const std::string& Roster::name_of(const std::string& peer) const {
  const auto found = workers_.find(peer);
  return found == workers_.end() ? peer : found->second.told.worker;
}

bool Roster::is_in_process(const std::string& peer) const {
  const auto found = workers_.find(peer);
  return found != workers_.end() && found->second.in_process;
}

std::vector<Candidate> Roster::candidates() const {
  std::vector<Candidate> all;
  for (const auto& [peer, worker] : workers_)
    all.push_back({worker.told.worker, worker.told.memory_mib, worker.told.live_only});
  return all;
}

Candidate Roster::candidate(const std::string& peer) const {
  const Worker& asked = workers_.at(peer);
  Candidate out{asked.told.worker, asked.told.memory_mib, asked.told.live_only};
  if (out.memory_mib == 0) return out;
  const auto reserved = reserved_mib_.find(memory_of(asked));
  if (reserved != reserved_mib_.end()) out.memory_mib -= reserved->second;
  out.memory_mib = std::max<std::int64_t>(out.memory_mib, 1);  // 0 would say "not told"
  return out;
}

void Roster::lease(const std::string& peer, std::int64_t token, std::int64_t job_id, std::int64_t need_mib,
                   Clock::time_point deadline) {
  Worker& worker = workers_[peer];
  spend_credit(worker);
  reserve(worker, need_mib);
  worker.token = token;
  worker.job_id = job_id;
  leases_[token] = {peer, deadline};
  deadlines_.insert({deadline, token});
}

bool Roster::extend(std::int64_t token, Clock::time_point deadline) {
  const auto found = leases_.find(token);
  if (found == leases_.end()) return false;
  deadlines_.erase({found->second.deadline, token});
  deadlines_.insert({deadline, token});
  found->second.deadline = deadline;
  return true;
}

void Roster::end(std::int64_t token) {
  const auto found = leases_.find(token);
  if (found == leases_.end()) return;
  if (const auto worker = workers_.find(found->second.peer);
      worker != workers_.end() && worker->second.token == token) {
    reserve(worker->second, 0);
    worker->second.token = worker->second.job_id = 0;
  }
  deadlines_.erase({found->second.deadline, token});
  leases_.erase(found);
}

std::vector<std::int64_t> Roster::expired(Clock::time_point now) const {
  std::vector<std::int64_t> tokens;
  for (const auto& [deadline, token] : deadlines_) {
    if (deadline > now) break;
    tokens.push_back(token);
  }
  return tokens;
}

std::optional<std::string> Roster::holder_of(std::int64_t token) const {
  const auto found = leases_.find(token);
  if (found == leases_.end()) return std::nullopt;
  return found->second.peer;
}

void Roster::drop_silent(Clock::time_point limit) {
  std::erase_if(workers_, [&](const auto& entry) {
    const bool silent = entry.second.token == 0 && entry.second.last_seen < limit;
    if (silent) idle_.erase(entry.second.credit);
    return silent;
  });
}

void Roster::void_leases() {
  leases_.clear();
  deadlines_.clear();
  reserved_mib_.clear();
  for (auto& [peer, worker] : workers_) worker.token = worker.job_id = worker.need_mib = 0;
}

std::vector<Status::Worker> Roster::status(Clock::time_point now) const {
  std::vector<Status::Worker> out;
  for (const auto& [peer, worker] : workers_) {
    const double silent_s = std::chrono::duration<double>(now - worker.last_seen).count();
    out.push_back({worker.told.worker, worker.job_id, silent_s, worker.told.host, worker.told.threads,
                   worker.told.cores, worker.told.memory_mib});
  }
  return out;
}

}  // namespace flamefield
