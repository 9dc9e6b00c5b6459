// The dispatcher's part on workers: who gets which job, and what came of it.
#include <algorithm>
#include <cmath>

#include "proto/utc.h"
#include "proto/version.h"
#include "services/dispatcher/desk.h"
#include "services/store/data_id.h"

namespace flamefield {

namespace {

constexpr int kMostCrashes = 2;  // then a job is taken to be poison

// A result file gets its final name; the round's end makes that durable.
Result<> publish_file(const std::filesystem::path& data_dir, const std::string& path, std::int64_t token) {
  const std::filesystem::path from = data_dir / staged_path(path, token);
  std::error_code problem;
  std::filesystem::rename(from, data_dir / path, problem);
  if (problem)
    return unavailable(concat("cannot rename ", from.string()), problem.message(),
                       "does the worker share the data directory?");
  return {};
}

}  // namespace

void Dispatcher::Impl::enqueue(const QueuedJob& job) {
  WaitingJob waiting{.id = job.id, .priority = job.priority, .share = job.share};
  waiting.paused = job.paused;
  waiting.tied_to = job.tied_to;
  const Cost cost = costs.estimate({job.setup, job.solver, job.work});
  waiting.cost_s = cost.wall_s > 0 ? cost.wall_s : 1;
  waiting.need_mib = std::lround(cost.peak_mib);
  // A clock that was set back must not make a back-off longer than any back-off is.
  const std::int64_t longest_ns = to_ns(options.back_off) << std::min(options.max_attempts, 10);
  const std::int64_t left_ns = std::min(job.not_before_ns - utc_now_ns(), longest_ns);
  if (left_ns > 0) waiting.not_before = steady_ns() + left_ns;
  queue.add(std::move(waiting));
}

// None: it may work.
std::optional<Error> Dispatcher::Impl::objection(const Ready& m) const {
  if (m.program_version != program_version())
    return invalid_input(concat("worker ", m.worker, " of version ", m.program_version),
                         concat("the dispatcher is ", program_version()), "install the same version")
        .value();
  if (!m.data_id.empty() && !data_id.empty() && m.data_id != data_id)
    return invalid_input(concat("worker ", m.worker, " on ", m.host),
                         m.data_id == kNoDataId
                             ? "it finds no volumes of this dispatcher in its data directory"
                             : "its data directory is not this dispatcher's",
                         "share the volumes directory under the same path on every node")
        .value();
  return std::nullopt;
}

Result<Message> Dispatcher::Impl::on(Ready& m, const Sender& sender) {
  if (auto error = objection(m)) {
    ++counters["workers_refused"];
    tell("worker-refused", m.worker, error->message, true);
    return Rejected{std::move(*error)};
  }
  roster.ready(sender.peer, m, sender.in_process, Clock::now());
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Heartbeat& m, const Sender&) {
  if (!roster.extend(m.progress.token, Clock::now() + options.lease)) return LeaseLost{m.progress.token};
  publisher.publish(m);
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Finish& m, const Sender&) {
  const auto commit = ledger.finish(m.token, m.run, utc_now_ns());
  if (!commit) return tl::unexpected(commit.error());
  if (*commit == Ledger::Commit::AlreadyDone) return Committed{m.run.id};
  if (*commit == Ledger::Commit::Stale) {
    ++counters["stale_commits_refused"];
    return invalid_input(concat("result of run ", m.run.id), "the lease was lost and given to another worker",
                         "drop it");
  }
  for (const std::string& path : {m.run.volume_path, m.run.projections_path}) {
    if (path.empty()) continue;
    if (auto ok = publish_file(options.data_dir, path, m.token); !ok) return tl::unexpected(ok.error());
    names_unsynced = true;
  }
  roster.end(m.token);
  const RunTimings& t = m.run.timings;
  const Cost cost{t.fetch_s + t.prepare_s + t.solve_s + t.write_s, m.run.peak_rss_mib};
  const double work = work_of(m.run.processing.grid, m.run.residual_per_view.size());
  costs.observe({setup_of(m.run.processing), m.run.solver, work}, cost);
  if (m.run.estimated_mib > 0 && cost.peak_mib > 1.5 * m.run.estimated_mib)
    ++counters["memory_underestimated"];
  if (m.run.estimated_s > 0 && cost.wall_s > 3 * m.run.estimated_s) ++counters["time_underestimated"];
  tell("run-committed", m.run.id, concat("worker ", m.run.worker), true);
  return Committed{m.run.id};
}

// The job of a lease goes back into the line, or has failed for good.
Result<> Dispatcher::Impl::end_lease(std::int64_t token, Failure failure, std::string_view event) {
  const auto job = ledger.held(token);
  if (!job) return tl::unexpected(job.error());
  if (!*job) return {};  // given back or cancelled before
  const auto failed = ledger.fail(token, failure);
  if (!failed) return tl::unexpected(failed.error());
  if (failure.retry_at_ns) {
    const auto waiting = ledger.queued_job((*job)->id);
    if (!waiting) return tl::unexpected(waiting.error());
    if (*waiting) enqueue(**waiting);
  }
  roster.end(token);
  tell(event, (*job)->run_id, failure.reason, true);
  return {};
}

Result<Message> Dispatcher::Impl::on(Fail& m, const Sender&) {
  const auto job = ledger.held(m.token);
  if (!job) return tl::unexpected(job.error());
  if (!*job) return Accepted{};
  Failure failure{.reason = m.error.message, .crashed = m.crashed};
  // Only what may be different next time is tried again.
  const bool hopeful = m.crashed
                           ? (*job)->crashes + 1 < kMostCrashes
                           : m.error.code == ErrorCode::Unavailable && (*job)->attempt < options.max_attempts;
  if (hopeful)
    failure.retry_at_ns = utc_now_ns() + (to_ns(options.back_off) << std::min((*job)->attempt - 1, 10));
  if (m.crashed) ++counters["worker_crashes"];
  const char* event = hopeful ? "job-put-back" : m.crashed ? "job-poisonous" : "job-failed";
  if (auto ok = end_lease(m.token, std::move(failure), event); !ok) return tl::unexpected(ok.error());
  return Accepted{};
}

Result<> Dispatcher::Impl::expire_leases() {
  for (const std::int64_t token : roster.expired(Clock::now())) {
    const auto job = ledger.held(token);
    if (!job) return tl::unexpected(job.error());
    if (!*job) {
      roster.end(token);
      continue;
    }
    Failure failure{.reason =
                        concat("worker ", (*job)->worker, " was silent for ", options.lease.count(), " ms")};
    if ((*job)->attempt < options.max_attempts) failure.retry_at_ns = utc_now_ns();
    ++counters["leases_expired"];
    if (auto ok = end_lease(token, std::move(failure), "lease-expired"); !ok) return ok;
  }
  for (const std::int64_t token : undelivered) {
    const std::string peer = roster.holder_of(token).value_or("");
    Failure failure{.reason = "the worker had gone", .retry_at_ns = utc_now_ns(), .counts = false};
    if (auto ok = end_lease(token, std::move(failure), "lease-undelivered"); !ok) return ok;
    roster.gone(peer);
  }
  undelivered.clear();
  return {};
}

Result<> Dispatcher::Impl::assign_work() {
  if (queue.size() == 0) return {};
  const auto all = queue.has_suspects() ? roster.candidates() : std::vector<Candidate>();
  for (const std::string& peer : roster.idle()) {
    if (queue.size() == 0) break;
    const auto job = queue.take(roster.candidate(peer), all, steady_ns());
    if (!job) continue;
    auto lease = ledger.lease(job->id, {.worker = roster.name_of(peer),
                                        .in_process = roster.is_in_process(peer),
                                        .now_ns = utc_now_ns(),
                                        .duration_ms = options.lease.count()});
    if (!lease) return tl::unexpected(lease.error());
    if (!*lease) continue;
    Job& given = (*lease)->job;
    const double work = work_of(given.processing.grid, (*lease)->rig.cameras.size());
    const Cost cost = costs.estimate({setup_of(given.processing), given.processing.recipe.solver, work});
    given.estimated_s = cost.wall_s;
    given.estimated_mib = cost.peak_mib;
    roster.lease(peer, (*lease)->token, job->id, std::lround(cost.peak_mib), Clock::now() + options.lease);
    news.push_back({utc_now_ns(), "job-leased", given.run_id, roster.name_of(peer)});
    letters.push_back({peer, 0, std::move(**lease)});
  }
  return {};
}

}  // namespace flamefield
