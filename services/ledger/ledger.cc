#include "services/ledger/ledger.h"

#include <sqlite3.h>

#include <limits>

#include "proto/check.h"
#include "services/ledger/database.h"
#include "services/ledger/lock.h"
#include "services/ledger/schema.h"

namespace flamefield {

namespace fs = std::filesystem;

fs::path ledger_path(const fs::path& directory) {
  return directory / "ledger.sqlite";
}

struct Ledger::Impl {
  Impl(FileLock held, const fs::path& path)
      : lock(std::move(held)),
        database(path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE, 5000),
        sql(database) {}

  // Found by a statement that selects one integer.
  template <class... Values>
  std::optional<std::int64_t> integer(const char* text, const Values&... values) {
    SQLite::Statement& statement = sql(text, values...);
    std::optional<std::int64_t> found;
    if (statement.executeStep() && !statement.getColumn(0).isNull())
      found = statement.getColumn(0).getInt64();
    statement.reset();
    return found;
  }

  FileLock lock;
  SQLite::Database database;
  Statements sql;
};

// An outer transaction, or a savepoint within one. Both roll back in their destructor.
struct Ledger::Transaction::Impl {
  Impl(SQLite::Database& d, bool is_outer) : database(d) {
    if (is_outer)
      outer.emplace(d, SQLite::TransactionBehavior::IMMEDIATE);
    else
      inner.emplace(d, "message");
  }
  SQLite::Database& database;
  std::optional<SQLite::Transaction> outer;
  std::optional<SQLite::Savepoint> inner;
};

Ledger::Transaction::Transaction(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Ledger::Transaction::Transaction(Transaction&&) noexcept = default;
Ledger::Transaction::~Transaction() = default;

Result<> Ledger::Transaction::commit() {
  return guarded(impl_->database, [&]() -> Result<> {
    if (impl_->outer)
      impl_->outer->commit();
    else
      impl_->inner->release();
    return {};
  });
}

Ledger::Ledger(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
Ledger::Ledger(Ledger&&) noexcept = default;
Ledger::~Ledger() = default;

Result<Ledger> Ledger::open(const fs::path& directory) {
  std::error_code problem;
  fs::create_directories(directory, problem);
  auto lock = FileLock::take(directory / "ledger.lock");
  if (!lock) return tl::unexpected(lock.error());
  const std::string file = ledger_path(directory).string();
  try {
    auto impl = std::make_unique<Impl>(std::move(*lock), file);
    impl->database.exec("PRAGMA journal_mode = WAL");
    impl->database.exec("PRAGMA synchronous = FULL");
    impl->database.exec("PRAGMA foreign_keys = ON");
    if (!migrate(impl->database))
      return invalid_input(concat("ledger ", file), "it was written by a newer version of this program",
                           "use that version");
    return Ledger(std::move(impl));
  } catch (const SQLite::Exception& exception) {
    return tl::unexpected(error_of(exception, file));
  }
}

Result<Ledger::Transaction> Ledger::begin() {
  return guarded(impl_->database, [&]() -> Result<Transaction> {
    return Transaction(std::make_unique<Transaction::Impl>(impl_->database, true));
  });
}

Result<Ledger::Transaction> Ledger::begin_within() {
  return guarded(impl_->database, [&]() -> Result<Transaction> {
    // A full disk makes SQLite roll the outer transaction back on its own.
    if (sqlite3_get_autocommit(impl_->database.getHandle()) != 0)
      return unavailable("change to the ledger", "its transaction was rolled back", "try again");
    return Transaction(std::make_unique<Transaction::Impl>(impl_->database, false));
  });
}

// --- captures and sets

Result<> Ledger::put_capture(const PutCapture& capture) {
  return guarded(impl_->database, [&]() -> Result<> {
    std::string cameras;
    for (const std::string& camera : capture.cameras) cameras += (cameras.empty() ? "" : " ") + camera;
    impl_->sql.run(
        "INSERT INTO captures(id, kind, started_time_ns, finished_time_ns, pulses, cameras) "
        "VALUES(?1, ?2, ?3, ?4, ?5, ?6) ON CONFLICT(id) DO UPDATE SET kind = ?2, started_time_ns = ?3, "
        "finished_time_ns = ?4, pulses = ?5, cameras = ?6",
        capture.id, name_of(capture.kind), capture.started_time_ns, capture.finished_time_ns, capture.pulses,
        cameras);
    return {};
  });
}

Result<bool> Ledger::add_set(const FrameSet& set, const SpoolLocation& location, std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<bool> {
    // A set may come before its capture was announced, e.g. when the spool is read after a crash.
    impl_->sql.run(
        "INSERT INTO captures(id, kind, started_time_ns) VALUES(?1, ?2, ?3) ON CONFLICT DO NOTHING",
        set.capture, name_of(set.kind), set.pulse_time_ns);
    const int added = impl_->sql.run(
        "INSERT INTO sets(capture, idx, pulse, pulse_time_ns, complete_time_ns, stored_time_ns, segment, "
        "byte_offset, byte_length, frames, losses) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11) "
        "ON CONFLICT(capture, idx) DO NOTHING",
        set.capture, set.index, set.pulse, set.pulse_time_ns, set.complete_time_ns, now_ns, location.segment,
        location.offset, location.length, set.frames.size(), set.losses.size());
    if (added == 0) return false;
    const std::int64_t id = impl_->database.getLastInsertRowid();
    constexpr const char* kFrame =
        "INSERT INTO frames(set_id, camera, loss) VALUES(?1, ?2, ?3) ON CONFLICT DO NOTHING";
    for (const Frame& frame : set.frames)
      impl_->sql.run(kFrame, id, frame.camera, std::optional<std::string_view>());
    for (const FrameLoss& loss : set.losses)
      impl_->sql.run(kFrame, id, loss.camera, std::optional<std::string_view>(name_of(loss.cause)));
    return true;
  });
}

Result<bool> Ledger::has_set(const SetId& id) {
  return guarded(impl_->database, [&]() -> Result<bool> {
    return impl_->integer("SELECT 1 FROM sets WHERE capture = ?1 AND idx = ?2", id.capture, id.index)
        .has_value();
  });
}

Result<SpoolLocation> Ledger::location_of(const SetId& id) {
  return guarded(impl_->database, [&]() -> Result<SpoolLocation> {
    auto& row =
        impl_->sql("SELECT segment, byte_offset, byte_length FROM sets WHERE capture = ?1 AND idx = ?2",
                   id.capture, id.index);
    if (!row.executeStep())
      return not_found(concat("set ", id.index, " of capture ", id.capture), "it is not in the ledger",
                       "see 'flamefield runs receipt'");
    const SpoolLocation location{row.getColumn(0).getUInt(),
                                 static_cast<std::uint64_t>(row.getColumn(1).getInt64()),
                                 static_cast<std::uint64_t>(row.getColumn(2).getInt64())};
    row.reset();
    return location;
  });
}

Result<std::vector<SetId>> Ledger::sets_of(const std::string& capture) {
  return guarded(impl_->database, [&]() -> Result<std::vector<SetId>> {
    std::vector<SetId> ids;
    auto& row = impl_->sql("SELECT idx FROM sets WHERE capture = ?1 ORDER BY idx", capture);
    while (row.executeStep()) ids.push_back({capture, row.getColumn(0).getInt64()});
    row.reset();
    return ids;
  });
}

Result<SpoolLocation> Ledger::last_location() {
  return guarded(impl_->database, [&]() -> Result<SpoolLocation> {
    SpoolLocation location;
    auto& row = impl_->sql(
        "SELECT segment, byte_offset, byte_length FROM sets ORDER BY segment DESC, byte_offset DESC LIMIT 1");
    if (row.executeStep())
      location = {row.getColumn(0).getUInt(), static_cast<std::uint64_t>(row.getColumn(1).getInt64()),
                  static_cast<std::uint64_t>(row.getColumn(2).getInt64())};
    row.reset();
    return location;
  });
}

// --- rigs, plan

Result<std::string> Ledger::put_rig(const Rig& rig, std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<std::string> {
    const std::string id = fingerprint(rig);
    // SQLite stores NaN as NULL.
    const double rms_px = rig.quality ? rig.quality->rms_px : std::numeric_limits<double>::quiet_NaN();
    impl_->sql.run(
        "INSERT INTO rigs(id, stored_time_ns, cameras, rms_px, record) VALUES(?1, ?2, ?3, ?4, ?5) "
        "ON CONFLICT DO NOTHING",
        id, now_ns, rig.cameras.size(), rms_px, Blob{encode(PutRig{rig})});
    return id;
  });
}

Result<Rig> Ledger::rig(const std::string& rig_id) {
  return guarded(impl_->database, [&]() -> Result<Rig> {
    auto& row = impl_->sql("SELECT record FROM rigs WHERE id = ?1", rig_id);
    if (!row.executeStep())
      return not_found(concat("rig ", rig_id), "it is not in the ledger", "store it first");
    auto record = record_of<PutRig>(row.getColumn(0));
    row.reset();
    if (!record) return tl::unexpected(record.error());
    return std::move(record->rig);
  });
}

Result<> Ledger::put_live_plan(const LivePlan& plan) {
  return guarded(impl_->database, [&]() -> Result<> {
    impl_->sql.run(
        "INSERT INTO live_plan(only_one, record) VALUES(1, ?1) ON CONFLICT(only_one) DO UPDATE SET record = "
        "?1",
        Blob{encode(plan)});
    return {};
  });
}

Result<LivePlan> Ledger::live_plan() {
  return guarded(impl_->database, [&]() -> Result<LivePlan> {
    auto& row = impl_->sql("SELECT record FROM live_plan");
    if (!row.executeStep()) return LivePlan{};
    auto plan = record_of<LivePlan>(row.getColumn(0));
    row.reset();
    return plan;
  });
}

// --- jobs

namespace {

std::string settings_text(const Recipe& recipe) {
  std::string text;
  for (const auto& [key, setting] : recipe.settings) text += key + "=" + text_of(setting) + "\n";
  return text;
}

}  // namespace

Result<std::optional<std::int64_t>> Ledger::add_job(const Job& job) {
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
        "state, created_time_ns, record) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, 'queued', ?8, ?9) "
        "ON CONFLICT(inputs_hash, recipe_hash, rig_id, program_version) WHERE state <> 'failed' DO NOTHING",
        job.run_id, inputs_fingerprint(job), recipe_fingerprint(p), p.rig_id, job.program_version, recipe_id,
        static_cast<int>(job.priority), job.created_time_ns, Blob{encode(Lease{0, 0, job, {}})});
    if (added == 0) return std::optional<std::int64_t>();
    const std::int64_t id = impl_->database.getLastInsertRowid();
    for (std::int64_t set : sets)
      impl_->sql.run("INSERT INTO job_inputs(job_id, set_id) VALUES(?1, ?2) ON CONFLICT DO NOTHING", id, set);
    return std::optional(id);
  });
}

Result<std::optional<Lease>> Ledger::lease_next(const std::string& worker, std::int64_t now_ns,
                                                std::int64_t duration_ms) {
  return guarded(impl_->database, [&]() -> Result<std::optional<Lease>> {
    auto& row = impl_->sql(
        "UPDATE jobs SET state = 'leased', attempt = attempt + 1, worker = ?1, leased_time_ns = ?2, "
        "lease_deadline_ns = ?3, lease_token = (SELECT max(lease_token) + 1 FROM jobs) "
        "WHERE id = (SELECT id FROM jobs WHERE state = 'queued' AND not_before_ns <= ?2 "
        "ORDER BY priority DESC, id LIMIT 1) RETURNING id, attempt, lease_token, rig_id, record",
        worker, now_ns, now_ns + duration_ms * 1'000'000);
    if (!row.executeStep()) return std::optional<Lease>();
    const std::int64_t id = row.getColumn(0).getInt64();
    const int attempt = row.getColumn(1).getInt();
    const std::int64_t token = row.getColumn(2).getInt64();
    const std::string rig_id = row.getColumn(3).getString();
    auto record = record_of<Lease>(row.getColumn(4));
    while (row.executeStep()) {
    }
    row.reset();
    if (!record) return tl::unexpected(record.error());
    auto stored = rig(rig_id);
    if (!stored) return tl::unexpected(stored.error());
    Lease lease{token, duration_ms, std::move(record->job), std::move(*stored)};
    lease.job.id = id;
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
        "record) SELECT run_id, id, inputs_hash, recipe_hash, rig_id, program_version, ?2, ?3, ?4, ?5, ?6, "
        "?7, "
        "?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16, ?17, ?18, ?19, ?20 FROM jobs WHERE id = ?1",
        *job, run.inputs.at(0).capture, run.inputs.at(0).index, run.inputs.size(), run.solver, run.worker,
        run.volume_path, run.volume_bytes, run.volume_fingerprint, run.iterations, run.residual,
        run.started_time_ns, run.finished_time_ns, now_ns, t.queue_s, t.fetch_s, t.prepare_s, t.solve_s,
        t.write_s, Blob{encode(Finish{token, run})});
    for (const auto& [name, value] : run.metrics)
      impl_->sql.run("INSERT INTO run_metrics(run_id, name, value) VALUES(?1, ?2, ?3)", run.id, name, value);
    return Commit::Done;
  });
}

Result<bool> Ledger::fail(std::int64_t token, const std::string& reason,
                          std::optional<std::int64_t> retry_at_ns) {
  return guarded(impl_->database, [&]() -> Result<bool> {
    return impl_->sql.run(
               "UPDATE jobs SET state = ?2, reason = ?3, not_before_ns = ?4 WHERE lease_token = ?1 AND state "
               "= "
               "'leased'",
               token, name_of(retry_at_ns ? JobState::Queued : JobState::Failed), reason,
               retry_at_ns.value_or(0)) == 1;
  });
}

Result<std::optional<std::int64_t>> Ledger::job_of_token(std::int64_t token) {
  return guarded(impl_->database, [&]() -> Result<std::optional<std::int64_t>> {
    return impl_->integer("SELECT id FROM jobs WHERE lease_token = ?1 AND state = 'leased'", token);
  });
}

Result<int> Ledger::attempt_of_token(std::int64_t token) {
  return guarded(impl_->database, [&]() -> Result<int> {
    return static_cast<int>(
        impl_->integer("SELECT attempt FROM jobs WHERE lease_token = ?1", token).value_or(0));
  });
}

Result<std::int64_t> Ledger::void_all_leases() {
  return guarded(impl_->database, [&]() -> Result<std::int64_t> {
    return impl_->sql.run(
        "UPDATE jobs SET state = 'queued', attempt = max(attempt - 1, 0), reason = 'dispatcher restarted' "
        "WHERE state = 'leased'");
  });
}

Result<std::optional<std::int64_t>> Ledger::next_due_ns() {
  return guarded(impl_->database, [&]() -> Result<std::optional<std::int64_t>> {
    return impl_->integer("SELECT min(not_before_ns) FROM jobs WHERE state = 'queued'");
  });
}

// --- the rest

Result<> Ledger::put_metrics(const PutMetrics& metrics) {
  return guarded(impl_->database, [&]() -> Result<> {
    if (!impl_->integer("SELECT 1 FROM runs WHERE id = ?1", metrics.run_id))
      return not_found(concat("run ", metrics.run_id), "it is not in the ledger",
                       "see 'flamefield runs list'");
    for (const auto& [name, value] : metrics.metrics)
      impl_->sql.run(
          "INSERT INTO run_metrics(run_id, name, value) VALUES(?1, ?2, ?3) ON CONFLICT(run_id, name) DO "
          "UPDATE "
          "SET value = ?3",
          metrics.run_id, name, value);
    return {};
  });
}

Result<> Ledger::add_event(const Event& event) {
  return guarded(impl_->database, [&]() -> Result<> {
    impl_->sql.run("INSERT INTO events(time_ns, kind, subject, text) VALUES(?1, ?2, ?3, ?4)", event.time_ns,
                   event.kind, event.subject, event.text);
    return {};
  });
}

Result<Status> Ledger::status(std::int64_t now_ns) {
  return guarded(impl_->database, [&]() -> Result<Status> {
    Status status;
    status.sets = impl_->integer("SELECT count(*) FROM sets").value_or(0);
    status.runs = impl_->integer("SELECT count(*) FROM runs").value_or(0);
    constexpr const char* kCount = "SELECT count(*) FROM jobs WHERE state = ?1";
    status.queued = impl_->integer(kCount, name_of(JobState::Queued)).value_or(0);
    status.leased = impl_->integer(kCount, name_of(JobState::Leased)).value_or(0);
    status.done = impl_->integer(kCount, name_of(JobState::Done)).value_or(0);
    status.failed = impl_->integer(kCount, name_of(JobState::Failed)).value_or(0);
    auto& row = impl_->sql(
        "SELECT id, not_before_ns, reason FROM jobs WHERE state = 'queued' ORDER BY priority DESC, id LIMIT "
        "20");
    while (row.executeStep()) {
      const double wait_s = static_cast<double>(row.getColumn(1).getInt64() - now_ns) * 1e-9;
      std::string why;
      if (wait_s > 0) why = concat("tried again in ", wait_s, " s after: ", row.getColumn(2).getString());
      status.waiting.push_back({row.getColumn(0).getInt64(), why});
    }
    row.reset();
    return status;
  });
}

}  // namespace flamefield
