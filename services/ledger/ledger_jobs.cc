// The writer's part on jobs: who may work on what, and what came of it.
#include "proto/check.h"
#include "services/ledger/writer.h"

namespace flamefield {

namespace {

std::string settings_text(const Recipe& recipe) {
  std::string text;
  for (const auto& [key, setting] : recipe.settings) text += key + "=" + text_of(setting) + "\n";
  return text;
}

// Ask for the columns that job_of() reads.
constexpr const char* kQueued =
    "SELECT j.id, priority, share, not_before_ns, paused, tied_to, recipe_hash || ' ' || rig_id, r.solver, "
    "work "
    "FROM jobs j JOIN recipes r ON r.id = recipe_id WHERE state = 'queued' AND (?1 IS NULL OR j.id = ?1)";

QueuedJob job_of(SQLite::Statement& row) {
  QueuedJob job;
  job.id = row.getColumn(0).getInt64();
  job.priority = static_cast<Priority>(row.getColumn(1).getInt());
  job.share = row.getColumn(2).getString();
  job.not_before_ns = row.getColumn(3).getInt64();
  job.paused = row.getColumn(4).getInt() != 0;
  job.tied_to = row.getColumn(5).getString();
  job.setup = row.getColumn(6).getString();
  job.solver = row.getColumn(7).getString();
  job.work = row.getColumn(8).getDouble();
  return job;
}

}  // namespace

std::string setup_of(const Processing& processing) {
  return concat(recipe_fingerprint(processing), ' ', processing.rig_id);
}

std::string share_of(const Job& job) {
  return job.submitter.empty() ? job.inputs.at(0).capture : job.submitter;
}

Result<std::optional<std::int64_t>> Ledger::add_job(const Job& job, double work) {
  expect(!job.inputs.empty(), "a job has inputs");
  return guarded(impl_->database, [&]() -> Result<std::optional<std::int64_t>> {
    const Processing& p = job.processing;
    if (!impl_->integer("SELECT 1 FROM rigs WHERE id = ?1", p.rig_id))
      return not_found(concat("rig ", p.rig_id), "it is not in the ledger", "store it first");
    std::vector<std::int64_t> sets;
    for (const SetId& input : job.inputs) {
      const auto id =
          impl_->integer("SELECT id FROM sets WHERE capture = ?1 AND idx = ?2", input.capture, input.index);
      if (!id)
        return not_found(concat("set ", input.index, " of capture ", input.capture),
                         "it is not in the ledger", "see 'flamefield runs receipt'");
      sets.push_back(*id);
    }
    const std::string recipe_id = fingerprint(p.recipe);
    impl_->sql.run("INSERT INTO recipes(id, solver, settings) VALUES(?1, ?2, ?3) ON CONFLICT DO NOTHING",
                   recipe_id, p.recipe.solver, settings_text(p.recipe));
    const int added = impl_->sql.run(
        "INSERT INTO jobs(run_id, inputs_hash, recipe_hash, rig_id, program_version, recipe_id, priority, "
        "state, created_time_ns, record, share, submitter, submission, work) "
        "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, 'queued', ?8, ?9, ?10, ?11, ?12, ?13) "
        "ON CONFLICT(inputs_hash, recipe_hash, rig_id, program_version) WHERE state <> 'failed' DO NOTHING",
        job.run_id, inputs_fingerprint(job), recipe_fingerprint(p), p.rig_id, job.program_version, recipe_id,
        static_cast<int>(job.priority), job.created_time_ns, Blob{encode(Lease{0, 0, job, {}})},
        share_of(job), job.submitter, job.submission, work);
    if (added == 0) return impl_->revive(job);
    const std::int64_t id = impl_->database.getLastInsertRowid();
    for (std::int64_t set : sets)
      impl_->sql.run("INSERT INTO job_inputs(job_id, set_id) VALUES(?1, ?2) ON CONFLICT DO NOTHING", id, set);
    return std::optional(id);
  });
}

Result<std::int64_t> Ledger::next_submission() {
  return guarded(impl_->database, [&]() -> Result<std::int64_t> {
    return impl_->integer("SELECT max(submission) + 1 FROM jobs").value_or(1);
  });
}

Result<std::vector<QueuedJob>> Ledger::queued_jobs() {
  return guarded(impl_->database, [&]() -> Result<std::vector<QueuedJob>> {
    std::vector<QueuedJob> jobs;
    auto& row = impl_->sql(kQueued, std::optional<std::int64_t>());
    while (row.executeStep()) jobs.push_back(job_of(row));
    row.reset();
    return jobs;
  });
}

Result<std::optional<QueuedJob>> Ledger::queued_job(std::int64_t id) {
  return guarded(impl_->database, [&]() -> Result<std::optional<QueuedJob>> {
    auto& row = impl_->sql(kQueued, std::optional(id));
    std::optional<QueuedJob> job;
    if (row.executeStep()) job = job_of(row);
    row.reset();
    return job;
  });
}

Result<std::optional<Lease>> Ledger::lease(std::int64_t job_id, const LeaseTerms& terms) {
  return guarded(impl_->database, [&]() -> Result<std::optional<Lease>> {
    auto& row = impl_->sql(
        "UPDATE jobs SET state = 'leased', attempt = attempt + 1, worker = ?1, leased_time_ns = ?2, "
        "lease_deadline_ns = ?3, in_process = ?4, lease_token = (SELECT max(lease_token) + 1 FROM jobs) "
        "WHERE id = ?5 AND state = 'queued' RETURNING attempt, lease_token, rig_id, record",
        terms.worker, terms.now_ns, terms.now_ns + terms.duration_ms * 1'000'000, terms.in_process ? 1 : 0,
        job_id);
    if (!row.executeStep()) {
      row.reset();
      return std::optional<Lease>();
    }
    const int attempt = row.getColumn(0).getInt();
    const std::int64_t token = row.getColumn(1).getInt64();
    const std::string rig_id = row.getColumn(2).getString();
    auto record = record_of<Lease>(row.getColumn(3));
    while (row.executeStep()) {
    }
    row.reset();
    if (!record) return tl::unexpected(record.error());
    auto stored = rig(rig_id);
    if (!stored) return tl::unexpected(stored.error());
    Lease lease{token, terms.duration_ms, std::move(record->job), std::move(*stored)};
    lease.job.id = job_id;
    lease.job.attempt = attempt;
    for (auto [capture, sets] : {std::pair(&lease.job.processing.dark_capture, &lease.job.dark),
                                 std::pair(&lease.job.processing.background_capture, &lease.job.background),
                                 std::pair(&lease.job.processing.flat_capture, &lease.job.flat)}) {
      if (capture->empty()) continue;
      auto found = sets_of(*capture);
      if (!found) return tl::unexpected(found.error());
      *sets = std::move(*found);
    }
    return std::optional(std::move(lease));
  });
}

Result<std::optional<HeldJob>> Ledger::held(std::int64_t token) {
  return guarded(impl_->database, [&]() -> Result<std::optional<HeldJob>> {
    auto& row = impl_->sql(
        "SELECT id, run_id, worker, attempt, crashes FROM jobs WHERE lease_token = ?1 AND state = 'leased'",
        token);
    std::optional<HeldJob> held;
    if (row.executeStep())
      held = {row.getColumn(0).getInt64(), row.getColumn(1).getString(), row.getColumn(2).getString(),
              row.getColumn(3).getInt(), row.getColumn(4).getInt()};
    row.reset();
    return held;
  });
}

Result<Ledger::Commit> Ledger::finish(std::int64_t token, const Run& run, std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<Commit> {
    if (impl_->integer("SELECT 1 FROM jobs WHERE lease_token = ?1 AND state = 'done' AND run_id = ?2", token,
                       run.id))
      return Commit::AlreadyDone;  // the answer to an earlier Finish was lost
    const auto job = impl_->integer(
        "SELECT id FROM jobs WHERE lease_token = ?1 AND state = 'leased' AND run_id = ?2", token, run.id);
    if (!job) return Commit::Stale;
    impl_->sql.run("UPDATE jobs SET state = 'done', reason = '' WHERE id = ?1", *job);
    const RunTimings& t = run.timings;
    impl_->sql.run(
        "INSERT INTO runs(id, job_id, inputs_hash, recipe_hash, rig_id, program_version, capture, first_idx, "
        "inputs, solver, worker, volume_path, volume_bytes, volume_fingerprint, iterations, residual, "
        "started_time_ns, finished_time_ns, committed_time_ns, queue_s, fetch_s, prepare_s, solve_s, "
        "write_s, "
        "record, estimated_s, estimated_mib, peak_rss_mib, work) SELECT run_id, id, inputs_hash, "
        "recipe_hash, rig_id, program_version, ?2, ?3, ?4, ?5, ?6, "
        "?7, "
        "?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20, ?21, ?22, ?23, work FROM jobs WHERE "
        "id = ?1 "
        // Made again after its files were retired.
        "ON CONFLICT(id) DO UPDATE SET worker = excluded.worker, volume_path = excluded.volume_path, "
        "volume_bytes = excluded.volume_bytes, volume_fingerprint = excluded.volume_fingerprint, "
        "iterations = excluded.iterations, residual = excluded.residual, "
        "started_time_ns = excluded.started_time_ns, finished_time_ns = excluded.finished_time_ns, "
        "committed_time_ns = excluded.committed_time_ns, queue_s = excluded.queue_s, "
        "fetch_s = excluded.fetch_s, prepare_s = excluded.prepare_s, solve_s = excluded.solve_s, "
        "write_s = excluded.write_s, peak_rss_mib = excluded.peak_rss_mib, record = excluded.record",
        *job, run.inputs.at(0).capture, run.inputs.at(0).index, run.inputs.size(), run.solver, run.worker,
        run.volume_path, run.volume_bytes, run.volume_fingerprint, run.iterations, run.residual,
        run.started_time_ns, run.finished_time_ns, now_ns, t.queue_s, t.fetch_s, t.prepare_s, t.solve_s,
        t.write_s, Blob{encode(Finish{token, run})}, run.estimated_s, run.estimated_mib, run.peak_rss_mib);
    for (const auto& [name, value] : run.metrics)
      impl_->sql.run("INSERT OR REPLACE INTO run_metrics(run_id, name, value) VALUES(?1, ?2, ?3)", run.id,
                     name, value);
    impl_->add_artefacts(run);
    return Commit::Done;
  });
}

Result<bool> Ledger::fail(std::int64_t token, const Failure& failure) {
  return guarded(impl_->database, [&]() -> Result<bool> {
    return impl_->sql.run(
               "UPDATE jobs SET state = ?2, reason = ?3, not_before_ns = ?4, crashes = crashes + ?5, "
               "tied_to = CASE ?5 WHEN 1 THEN worker ELSE tied_to END, "
               "attempt = max(0, attempt - ?6) WHERE lease_token = ?1 AND state = 'leased'",
               token, name_of(failure.retry_at_ns ? JobState::Queued : JobState::Failed), failure.reason,
               failure.retry_at_ns.value_or(0), failure.crashed ? 1 : 0, failure.counts ? 0 : 1) == 1;
  });
}

Result<std::int64_t> Ledger::void_all_leases(bool restarted) {
  return guarded(impl_->database, [&]() -> Result<std::int64_t> {
    const std::int64_t blame = restarted ? 1 : 0;
    const std::int64_t given_up = impl_->sql.run(
        "UPDATE jobs SET state = 'failed', crashes = crashes + 1, reason = 'the program died three times "
        "while it worked on this' WHERE state = 'leased' AND in_process = 1 AND crashes >= 2 AND ?1 = 1",
        blame);
    return given_up + impl_->sql.run(
                          "UPDATE jobs SET state = 'queued', attempt = max(attempt - 1, 0), "
                          "crashes = crashes + in_process * ?1, reason = ?2 WHERE state = 'leased'",
                          blame, restarted ? "dispatcher restarted" : "the disk refused");
  });
}

}  // namespace flamefield
