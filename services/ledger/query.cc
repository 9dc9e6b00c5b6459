#include "services/ledger/query.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "services/ledger/read_only.h"

namespace flamefield {

LedgerQuery::LedgerQuery(std::unique_ptr<ReadOnlyLedger> ledger) : ledger_(std::move(ledger)) {}
LedgerQuery::LedgerQuery(LedgerQuery&&) noexcept = default;
LedgerQuery::~LedgerQuery() = default;

Result<LedgerQuery> LedgerQuery::open(const std::filesystem::path& directory) {
  return open_read_only(directory).map(
      [](std::unique_ptr<ReadOnlyLedger> ledger) { return LedgerQuery(std::move(ledger)); });
}

namespace {

// A statement of its own: its text depends on the filter.
SQLite::Statement prepared(SQLite::Database& database, const std::string& text, const Filter& filter) {
  SQLite::Statement statement(database, text);
  int i = 0;
  for (const FilterValue& value : filter.values)
    std::visit([&](const auto& v) { statement.bind(++i, v); }, value);
  return statement;
}

// What is done, with as much around it as the condition asks for: an index holds all that is asked most
// often.
std::string done(const std::string& condition) {
  const auto names = [&](const char* alias) { return condition.find(alias) != std::string::npos; };
  std::string text = " FROM runs r";
  if (names("j.") || names("p.")) text += " LEFT JOIN jobs j ON j.id = r.job_id";
  if (names("p.")) text += " LEFT JOIN recipes p ON p.id = j.recipe_id";
  if (names("s.")) text += " LEFT JOIN sets s ON s.capture = r.capture AND s.idx = r.first_idx";
  if (names("c.")) text += " LEFT JOIN captures c ON c.id = r.capture";
  return text;
}
constexpr const char* kAny =
    " FROM jobs j LEFT JOIN runs r ON r.job_id = j.id LEFT JOIN recipes p ON p.id = j.recipe_id "
    "LEFT JOIN sets s ON s.id = (SELECT min(set_id) FROM job_inputs WHERE job_id = j.id) "
    "LEFT JOIN captures c ON c.id = s.capture";
constexpr const char* kSets = " FROM sets s JOIN captures c ON c.id = s.capture";

std::string where(const Filter& filter) {
  return filter.condition.empty() ? std::string() : " WHERE " + filter.condition;
}

// What is known of work before it is done.
Run run_of(const Job& job) {
  Run run;
  run.id = job.run_id;
  run.inputs = job.inputs;
  run.processing = job.processing;
  run.program_version = job.program_version;
  run.solver = job.processing.recipe.solver;
  return run;
}

Result<WorkRow> read_work(Statements& sql, std::int64_t job_id) {
  WorkRow work;
  auto& row = sql(
      "SELECT j.state, j.reason, r.committed_time_ns, coalesce(r.record, j.record), r.id IS NOT NULL, "
      "EXISTS(SELECT 1 FROM artefacts a WHERE a.run_id = j.run_id AND retired_time_ns > 0) FROM jobs j LEFT "
      "JOIN runs r ON r.job_id = j.id WHERE j.id = ?1",
      job_id);
  row.executeStep();
  work.state = job_state_from_name(row.getColumn(0).getString()).value_or(JobState::Failed);
  work.reason = row.getColumn(1).getString();
  work.committed_time_ns = row.getColumn(2).getInt64();
  work.retired = row.getColumn(5).getInt() != 0;
  if (row.getColumn(4).getInt() != 0) {
    auto record = record_of<Finish>(row.getColumn(3));
    if (!record) return tl::unexpected(record.error());
    work.run = std::move(record->run);
  } else {
    auto record = record_of<Lease>(row.getColumn(3));
    if (!record) return tl::unexpected(record.error());
    work.run = run_of(record->job);
  }
  row.reset();
  auto& metric = sql("SELECT name, value FROM run_metrics WHERE run_id = ?1", work.run.id);
  while (metric.executeStep())
    work.run.metrics[metric.getColumn(0).getString()] = metric.getColumn(1).getDouble();
  metric.reset();
  static const std::string kIsStale =
      concat("SELECT ", parse_filter("stale", 0)->condition, done("s."), " WHERE r.job_id = ?1");
  auto& stale = sql(kIsStale.c_str(), job_id);
  work.stale = stale.executeStep() && stale.getColumn(0).getInt() != 0;
  stale.reset();
  auto& tag = sql("SELECT DISTINCT tag FROM tags WHERE subject IN (?1, ?2) ORDER BY tag", work.run.id,
                  work.run.inputs.empty() ? std::string() : work.run.inputs.front().capture);
  while (tag.executeStep()) work.tags.push_back(tag.getColumn(0).getString());
  tag.reset();
  return work;
}

}  // namespace

Result<std::vector<WorkRow>> LedgerQuery::work(const Filter& filter, std::int64_t limit) {
  return guarded(ledger_->database, [&]() -> Result<std::vector<WorkRow>> {
    // First which ones, without touching their records; then each of the few.
    const std::string which =
        filter.mentions_state
            ? concat("SELECT j.id", kAny, where(filter), " ORDER BY j.id DESC LIMIT ", limit)
            : concat("SELECT r.job_id", done(filter.condition), where(filter),
                     " ORDER BY r.committed_time_ns DESC LIMIT ", limit);
    auto row = prepared(ledger_->database, which, filter);
    std::vector<WorkRow> rows;
    while (row.executeStep()) {
      auto work = read_work(ledger_->sql, row.getColumn(0).getInt64());
      if (!work) return tl::unexpected(work.error());
      rows.push_back(std::move(*work));
    }
    return rows;
  });
}

Result<WorkRow> LedgerQuery::run(const std::string& run_id) {
  return guarded(ledger_->database, [&]() -> Result<WorkRow> {
    auto& row = ledger_->sql("SELECT job_id FROM runs WHERE id = ?1", run_id);
    const bool found = row.executeStep();
    const std::int64_t job_id = found ? row.getColumn(0).getInt64() : 0;
    row.reset();
    if (!found)
      return not_found(concat("run ", run_id), "it is not in the ledger", "see 'flamefield runs list'");
    return read_work(ledger_->sql, job_id);
  });
}

Result<std::int64_t> LedgerQuery::count_work(const Filter& filter) {
  return guarded(ledger_->database, [&]() -> Result<std::int64_t> {
    const std::string from = filter.mentions_state ? std::string(kAny) : done(filter.condition);
    auto row = prepared(ledger_->database, concat("SELECT count(*)", from, where(filter)), filter);
    row.executeStep();
    return row.getColumn(0).getInt64();
  });
}

Result<std::vector<SetId>> LedgerQuery::sets(const Filter& filter) {
  return guarded(ledger_->database, [&]() -> Result<std::vector<SetId>> {
    auto row = prepared(ledger_->database,
                        concat("SELECT s.capture, s.idx", kSets, where(filter), " ORDER BY s.capture, s.idx"),
                        filter);
    std::vector<SetId> ids;
    while (row.executeStep()) ids.push_back({row.getColumn(0).getString(), row.getColumn(1).getInt64()});
    return ids;
  });
}

Result<std::optional<Processing>> LedgerQuery::newest_processing() {
  return guarded(ledger_->database, [&]() -> Result<std::optional<Processing>> {
    auto& row = ledger_->sql("SELECT record FROM runs ORDER BY committed_time_ns DESC LIMIT 1");
    if (row.executeStep()) {
      auto record = record_of<Finish>(row.getColumn(0));
      row.reset();
      if (!record) return tl::unexpected(record.error());
      return std::optional(std::move(record->run.processing));
    }
    auto& plan = ledger_->sql("SELECT record FROM live_plan");
    if (!plan.executeStep()) return std::optional<Processing>();
    auto record = record_of<LivePlan>(plan.getColumn(0));
    plan.reset();
    if (!record) return tl::unexpected(record.error());
    return record->processing.rig_id.empty() ? std::nullopt : std::optional(std::move(record->processing));
  });
}

Result<bool> LedgerQuery::has_work(const Job& job) {
  return guarded(ledger_->database, [&]() -> Result<bool> {
    auto& row = ledger_->sql(
        "SELECT 1 FROM jobs j WHERE inputs_hash = ?1 AND recipe_hash = ?2 AND rig_id = ?3 AND "
        "program_version = ?4 AND state <> 'failed' AND NOT (state = 'done' AND EXISTS(SELECT 1 FROM "
        "artefacts a WHERE a.run_id = j.run_id AND retired_time_ns > 0))",
        inputs_fingerprint(job), recipe_fingerprint(job.processing), job.processing.rig_id,
        job.program_version);
    const bool found = row.executeStep();
    row.reset();
    return found;
  });
}

Result<PastWork> LedgerQuery::past_work(const std::string& solver, const Grid& grid) {
  return guarded(ledger_->database, [&]() -> Result<PastWork> {
    // The newest ones tell most of this machine as it is now.
    auto& row = ledger_->sql(
        "SELECT record FROM runs WHERE solver = ?1 ORDER BY committed_time_ns DESC LIMIT 200", solver);
    std::vector<double> seconds;
    PastWork past;
    while (row.executeStep()) {
      const auto record = record_of<Finish>(row.getColumn(0));
      if (!record) return tl::unexpected(record.error());
      const Run& run = record->run;
      const RunTimings& t = run.timings;
      const auto voxels = [](const Grid& g) {
        return static_cast<double>(g.nx) * static_cast<double>(g.ny) * static_cast<double>(g.nz);
      };
      const double scale = voxels(grid) / voxels(run.processing.grid);
      seconds.push_back(t.fetch_s + t.prepare_s + scale * (t.solve_s + t.write_s));
      past.peak_rss_mib = std::max(past.peak_rss_mib, std::max(1.0, scale) * run.peak_rss_mib);
    }
    row.reset();
    past.runs = static_cast<std::int64_t>(seconds.size());
    if (seconds.empty()) return past;
    const auto middle = seconds.begin() + static_cast<std::ptrdiff_t>(seconds.size() / 2);
    std::nth_element(seconds.begin(), middle, seconds.end());
    past.seconds = *middle;
    return past;
  });
}

Result<std::vector<AcceptedRigRow>> LedgerQuery::accepted_rigs() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<AcceptedRigRow>> {
    std::vector<AcceptedRigRow> rows;
    auto& row = ledger_->sql(
        "SELECT rig_id, accepted_time_ns, since_ns, rms_px FROM accepted_rigs JOIN rigs ON rigs.id = rig_id "
        "ORDER BY accepted_time_ns DESC");
    while (row.executeStep())
      rows.push_back({row.getColumn(0).getString(), row.getColumn(1).getInt64(), row.getColumn(2).getInt64(),
                      row.getColumn(3).isNull() ? std::numeric_limits<double>::quiet_NaN()
                                                : row.getColumn(3).getDouble()});
    row.reset();
    return rows;
  });
}

Result<std::optional<std::string>> LedgerQuery::rig_for(const SetId& id) {
  return guarded(ledger_->database, [&]() -> Result<std::optional<std::string>> {
    auto& row = ledger_->sql(
        "SELECT a.rig_id FROM sets s, accepted_rigs a WHERE s.capture = ?1 AND s.idx = ?2 AND a.since_ns <= "
        "s.pulse_time_ns ORDER BY a.accepted_time_ns DESC LIMIT 1",
        id.capture, id.index);
    std::optional<std::string> found;
    if (row.executeStep()) found = row.getColumn(0).getString();
    row.reset();
    return found;
  });
}

Result<std::vector<ScheduleRow>> LedgerQuery::schedules() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<ScheduleRow>> {
    std::vector<ScheduleRow> rows;
    auto& row = ledger_->sql(
        "SELECT d.record, d.last_due_ns, (SELECT count(*) FROM schedule_jobs x JOIN jobs j ON j.id = "
        "x.job_id "
        "WHERE x.schedule = d.name AND j.state IN ('queued', 'leased')), h.time_ns, h.outcome, h.text FROM "
        "schedules d LEFT JOIN schedule_runs h ON h.id = (SELECT max(id) FROM schedule_runs WHERE schedule = "
        "d.name) ORDER BY d.name");
    while (row.executeStep()) {
      auto record = record_of<PutSchedule>(row.getColumn(0));
      if (!record) return tl::unexpected(record.error());
      record->schedule.last_due_ns = row.getColumn(1).getInt64();
      rows.push_back({std::move(record->schedule), row.getColumn(2).getInt64(), row.getColumn(3).getInt64(),
                      row.getColumn(4).getString(), row.getColumn(5).getString()});
    }
    row.reset();
    return rows;
  });
}

}  // namespace flamefield
