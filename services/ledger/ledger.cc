#include "services/ledger/ledger.h"

#include <sqlite3.h>

#include <limits>

#include "services/ledger/schema.h"
#include "services/ledger/writer.h"

namespace flamefield {

namespace fs = std::filesystem;

fs::path ledger_path(const fs::path& directory) {
  return directory / "ledger.sqlite";
}

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
    // For thousands of commits a second: indices stay in memory, and a checkpoint, which syncs twice, comes
    // every 32 MiB instead of every 4.
    impl->database.exec("PRAGMA cache_size = -65536");
    impl->database.exec("PRAGMA wal_autocheckpoint = 8192");
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

Result<CalibrationStored> Ledger::put_calibration(const PutCalibration& accepted, std::int64_t now_ns) {
  const auto rig_id = put_rig(accepted.rig, now_ns);
  if (!rig_id) return tl::unexpected(rig_id.error());
  return guarded(impl_->database, [&]() -> Result<CalibrationStored> {
    auto& last = impl_->sql("SELECT coalesce(max(version), 0) FROM calibrations");
    last.executeStep();
    PutCalibration kept{accepted.calibration, accepted.rig};
    Calibration& c = kept.calibration;
    c.predecessor = last.getColumn(0).getInt64();
    last.reset();
    c.version = c.predecessor + 1;
    c.rig_id = *rig_id;
    c.accepted_time_ns = now_ns;
    impl_->sql.run(
        "INSERT INTO calibrations(version, predecessor, rig_id, accepted_time_ns, accepted_by, note, "
        "volume_mean_px, volume_worst_px, verdict, record) VALUES(?1, nullif(?2, 0), ?3, ?4, ?5, ?6, ?7, ?8, "
        "?9, ?10)",
        c.version, c.predecessor, c.rig_id, c.accepted_time_ns, c.accepted_by, c.note, c.volume_mean_px,
        c.volume_worst_px, c.verdict, Blob{encode(kept)});
    // It counts for what was taken since the one before: any time in between a camera may have been bumped.
    impl_->sql.run(
        "INSERT INTO accepted_rigs(rig_id, accepted_time_ns, since_ns) SELECT ?1, ?2, "
        "coalesce(max(accepted_time_ns), 0) FROM accepted_rigs",
        c.rig_id, now_ns);
    return CalibrationStored{c.version, c.rig_id};
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

Result<Status> Ledger::status() {
  return guarded(impl_->database, [&]() -> Result<Status> {
    std::map<std::string, std::int64_t> totals;
    auto& row = impl_->sql("SELECT what, n FROM totals");
    while (row.executeStep()) totals[row.getColumn(0).getString()] = row.getColumn(1).getInt64();
    row.reset();
    Status status;
    status.sets = totals["sets"], status.runs = totals["runs"];
    status.queued = totals["queued"], status.leased = totals["leased"];
    status.done = totals["done"], status.failed = totals["failed"];
    return status;
  });
}

}  // namespace flamefield
