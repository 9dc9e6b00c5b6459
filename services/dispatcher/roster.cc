#include "services/dispatcher/roster.h"

#include <algorithm>

namespace flamefield {

void Roster::ready(const std::string& peer, const std::string& name, Clock::time_point now) {
  Worker& worker = workers_[peer];
  worker.name = name;
  worker.last_seen = now;
  // A Ready that crossed its Lease on the way is no second credit.
  if (worker.token == 0 && std::find(idle_.begin(), idle_.end(), peer) == idle_.end()) idle_.push_back(peer);
}

void Roster::seen(const std::string& peer, Clock::time_point now) {
  if (const auto found = workers_.find(peer); found != workers_.end()) found->second.last_seen = now;
}

void Roster::gone(const std::string& peer) {
  std::erase(idle_, peer);
  workers_.erase(peer);
}

std::optional<std::string> Roster::take_idle() {
  if (idle_.empty()) return std::nullopt;
  std::string peer = std::move(idle_.front());
  idle_.pop_front();
  return peer;
}

const std::string& Roster::name_of(const std::string& peer) const {
  const auto found = workers_.find(peer);
  return found == workers_.end() ? peer : found->second.name;
}

void Roster::lease(const std::string& peer, std::int64_t token, std::int64_t job_id,
                   Clock::time_point deadline) {
  workers_[peer].token = token;
  workers_[peer].job_id = job_id;
  leases_[token] = {peer, deadline};
}

bool Roster::extend(std::int64_t token, Clock::time_point deadline) {
  const auto found = leases_.find(token);
  if (found == leases_.end()) return false;
  found->second.deadline = deadline;
  return true;
}

void Roster::end(std::int64_t token) {
  const auto found = leases_.find(token);
  if (found == leases_.end()) return;
  if (const auto worker = workers_.find(found->second.peer);
      worker != workers_.end() && worker->second.token == token) {
    worker->second.token = 0;
    worker->second.job_id = 0;
  }
  leases_.erase(found);
}

std::vector<std::int64_t> Roster::expired(Clock::time_point now) const {
  std::vector<std::int64_t> tokens;
  for (const auto& [token, held] : leases_) {
    if (held.deadline <= now) tokens.push_back(token);
  }
  return tokens;
}

std::optional<std::string> Roster::holder_of(std::int64_t token) const {
  const auto found = leases_.find(token);
  if (found == leases_.end()) return std::nullopt;
  return name_of(found->second.peer);
}

void Roster::drop_silent(Clock::time_point limit) {
  std::erase_if(workers_, [&](const auto& entry) {
    const bool silent = entry.second.token == 0 && entry.second.last_seen < limit;
    if (silent) std::erase(idle_, entry.first);
    return silent;
  });
}

void Roster::void_leases() {
  leases_.clear();
  for (auto& [peer, worker] : workers_) worker.token = worker.job_id = 0;
}

std::vector<Status::Worker> Roster::status(Clock::time_point now) const {
  std::vector<Status::Worker> out;
  for (const auto& [peer, worker] : workers_)
    out.push_back(
        {worker.name, worker.job_id, std::chrono::duration<double>(now - worker.last_seen).count()});
  return out;
}

}  // namespace flamefield
