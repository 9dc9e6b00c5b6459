// The writer's part on the control of jobs, and on what is asked about them.
#include <algorithm>

#include "services/ledger/writer.h"

namespace flamefield {

namespace {

// ?1: a job or NULL, ?2: a submission or NULL; both NULL: all jobs.
const char* statement_of(JobAction action) {
  switch (action) {
    case JobAction::Pause:
      return "UPDATE jobs SET paused = 1 WHERE paused = 0 AND state IN ('queued', 'leased') AND "
             "(?1 IS NULL OR id = ?1) AND (?2 IS NULL OR submission = ?2) RETURNING id, lease_token";
    case JobAction::Resume:
      return "UPDATE jobs SET paused = 0 WHERE paused = 1 AND state IN ('queued', 'leased') AND "
             "(?1 IS NULL OR id = ?1) AND (?2 IS NULL OR submission = ?2) RETURNING id, lease_token";
    case JobAction::Cancel:
      return "UPDATE jobs SET state = 'failed', cancelled = 1, reason = 'cancelled' "
             "WHERE state IN ('queued', 'leased') AND (?1 IS NULL OR id = ?1) AND "
             "(?2 IS NULL OR submission = ?2) RETURNING id, lease_token";
    case JobAction::Retry:
      // Work that was asked for again since stays failed. Cancelled jobs come back only when they are named.
      return "UPDATE OR IGNORE jobs SET state = 'queued', attempt = 0, crashes = 0, cancelled = 0, paused = "
             "0, "
             "tied_to = '', not_before_ns = 0, reason = '' WHERE state = 'failed' AND "
             "(?1 IS NULL OR id = ?1) AND (?2 IS NULL OR submission = ?2) AND "
             "(?1 IS NOT NULL OR cancelled = 0) RETURNING id, lease_token";
  }
  return "";
}

}  // namespace

Result<std::vector<ControlledJob>> Ledger::control(const ControlJobs& what) {
  return guarded(impl_->database, [&]() -> Result<std::vector<ControlledJob>> {
    std::vector<ControlledJob> changed;
    const auto apply = [&](std::optional<std::int64_t> job, std::optional<std::int64_t> submission) {
      auto& row = impl_->sql(statement_of(what.action), job, submission);
      while (row.executeStep()) changed.push_back({row.getColumn(0).getInt64(), row.getColumn(1).getInt64()});
      row.reset();
    };
    if (what.all) {
      apply(std::nullopt, std::nullopt);
    } else {
      for (const std::int64_t id : what.jobs) apply(id, std::nullopt);
      if (what.submission != 0) apply(std::nullopt, what.submission);
    }
    return changed;
  });
}

Result<> Ledger::pause_all(bool paused) {
  return guarded(impl_->database, [&]() -> Result<> {
    impl_->sql.run(
        "INSERT INTO control(only_one, paused) VALUES(1, ?1) ON CONFLICT(only_one) DO UPDATE SET paused = ?1",
        paused ? 1 : 0);
    return {};
  });
}

Result<bool> Ledger::paused_all() {
  return guarded(impl_->database, [&]() -> Result<bool> {
    return impl_->integer("SELECT paused FROM control").value_or(0) != 0;
  });
}

Result<std::vector<Jobs::Row>> Ledger::jobs(const GetJobs& asked) {
  return guarded(impl_->database, [&]() -> Result<std::vector<Jobs::Row>> {
    std::vector<Jobs::Row> rows;
    const auto read = [&](SQLite::Statement& row) {
      while (row.executeStep()) {
        Jobs::Row job;
        job.id = row.getColumn(0).getInt64();
        job.run_id = row.getColumn(1).getString();
        job.state = job_state_from_name(row.getColumn(2).getString()).value_or(JobState::Failed);
        job.priority = static_cast<Priority>(row.getColumn(3).getInt());
        job.submitter = row.getColumn(4).getString();
        job.submission = row.getColumn(5).getInt64();
        job.attempt = row.getColumn(6).getInt();
        job.worker = row.getColumn(7).getString();
        job.created_time_ns = row.getColumn(8).getInt64();
        job.why = row.getColumn(9).getString();
        rows.push_back(std::move(job));
      }
      row.reset();
    };
    // One statement for each index.
    if (asked.submission != 0) {
      read(impl_->sql(
          "SELECT id, run_id, state, priority, share, submission, attempt, worker, created_time_ns, "
          "reason FROM jobs WHERE submission = ?1 AND (?2 IS NULL OR state = ?2) ORDER BY id DESC "
          "LIMIT ?3",
          asked.submission, asked.state ? std::optional(name_of(*asked.state)) : std::nullopt, asked.limit));
    } else if (asked.state) {
      read(impl_->sql(
          "SELECT id, run_id, state, priority, share, submission, attempt, worker, created_time_ns, "
          "reason FROM jobs WHERE state = ?1 ORDER BY id DESC LIMIT ?2",
          name_of(*asked.state), asked.limit));
    } else {
      read(impl_->sql(
          "SELECT id, run_id, state, priority, share, submission, attempt, worker, created_time_ns, "
          "reason FROM jobs ORDER BY id DESC LIMIT ?1",
          asked.limit));
    }
    std::reverse(rows.begin(), rows.end());
    return rows;
  });
}

Result<std::string> Ledger::reason_of(std::int64_t job_id) {
  return guarded(impl_->database, [&]() -> Result<std::string> {
    auto& row = impl_->sql("SELECT reason FROM jobs WHERE id = ?1", job_id);
    const std::string reason = row.executeStep() ? row.getColumn(0).getString() : std::string();
    row.reset();
    return reason;
  });
}

Result<std::vector<RunCost>> Ledger::costs(std::int64_t limit) {
  return guarded(impl_->database, [&]() -> Result<std::vector<RunCost>> {
    std::vector<RunCost> costs;
    auto& row = impl_->sql(
        "SELECT recipe_hash || ' ' || rig_id, solver, work, fetch_s + prepare_s + solve_s + write_s, "
        "peak_rss_mib FROM runs ORDER BY committed_time_ns DESC LIMIT ?1",
        limit);
    while (row.executeStep())
      costs.push_back({row.getColumn(0).getString(), row.getColumn(1).getString(),
                       row.getColumn(2).getDouble(), row.getColumn(3).getDouble(),
                       row.getColumn(4).getDouble()});
    row.reset();
    std::reverse(costs.begin(), costs.end());
    return costs;
  });
}

}  // namespace flamefield
