#include "services/ledger/reader.h"

#include <algorithm>

#include "services/ledger/read_only.h"

namespace flamefield {

LedgerReader::LedgerReader(std::unique_ptr<ReadOnlyLedger> ledger) : ledger_(std::move(ledger)) {}
LedgerReader::LedgerReader(LedgerReader&&) noexcept = default;
LedgerReader::~LedgerReader() = default;

Result<LedgerReader> LedgerReader::open(const std::filesystem::path& directory) {
  return open_read_only(directory).map(
      [](std::unique_ptr<ReadOnlyLedger> ledger) { return LedgerReader(std::move(ledger)); });
}

namespace {

// The first columns of whoever asks.
constexpr const char* kCaptureColumns =
    "c.id, kind, started_time_ns, finished_time_ns, pulses, cameras, pulses_wanted, pre_pulses, ending, "
    "end_reason, settings";

PutCapture capture_of(SQLite::Statement& row) {
  PutCapture capture;
  capture.id = row.getColumn(0).getString();
  capture.kind = capture_kind_from_name(row.getColumn(1).getString()).value_or(CaptureKind::Burst);
  capture.started_time_ns = row.getColumn(2).getInt64();
  capture.finished_time_ns = row.getColumn(3).getInt64();
  capture.pulses = row.getColumn(4).getInt64();
  std::istringstream names(row.getColumn(5).getString());
  for (std::string name; names >> name;) capture.cameras.push_back(name);
  capture.pulses_wanted = row.getColumn(6).getInt64();
  capture.pre_pulses = row.getColumn(7).getInt64();
  capture.end = capture_end_from_name(row.getColumn(8).getString()).value_or(CaptureEnd::None);
  capture.end_reason = row.getColumn(9).getString();
  std::istringstream settings(row.getColumn(10).getString());
  for (std::string line; std::getline(settings, line);) {
    const std::size_t equals = line.find('=');
    if (equals != std::string::npos) capture.settings[line.substr(0, equals)] = line.substr(equals + 1);
  }
  return capture;
}

tl::unexpected<Error> unknown(std::string_view what, const std::string& id) {
  return not_found(concat(what, ' ', id), "it is not in the ledger", "list what there is");
}

}  // namespace

Result<std::vector<CaptureRow>> LedgerReader::captures() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<CaptureRow>> {
    std::vector<CaptureRow> rows;
    static const std::string kQuestion =
        concat("SELECT ", kCaptureColumns,
               ", count(s.id), coalesce(sum(s.frames), 0), coalesce(sum(s.losses), 0) FROM captures c "
               "LEFT JOIN sets s ON s.capture = c.id GROUP BY c.id ORDER BY started_time_ns, c.id");
    auto& row = ledger_->sql(kQuestion.c_str());
    while (row.executeStep())
      rows.push_back({capture_of(row), row.getColumn(11).getInt64(), row.getColumn(12).getInt64(),
                      row.getColumn(13).getInt64()});
    row.reset();
    return rows;
  });
}

Result<std::vector<SetRow>> LedgerReader::sets(const std::string& capture) {
  return guarded(ledger_->database, [&]() -> Result<std::vector<SetRow>> {
    std::vector<SetRow> rows;
    auto& row = ledger_->sql(
        "SELECT idx, pulse, pulse_time_ns, complete_time_ns, stored_time_ns, frames, losses FROM sets "
        "WHERE capture = ?1 ORDER BY idx",
        capture);
    const auto integer = [&](int column) { return row.getColumn(column).getInt64(); };
    while (row.executeStep())
      rows.push_back(
          {{capture, integer(0)}, integer(1), integer(2), integer(3), integer(4), integer(5), integer(6)});
    row.reset();
    return rows;
  });
}

namespace {

// Columns: record, committed_time_ns.
Result<std::vector<RunRow>> read_runs(SQLite::Statement& row, Statements& sql) {
  std::vector<RunRow> rows;
  while (row.executeStep()) {
    auto record = record_of<Finish>(row.getColumn(0));
    if (!record) return tl::unexpected(record.error());
    rows.push_back({std::move(record->run), row.getColumn(1).getInt64()});
  }
  row.reset();
  for (RunRow& run : rows) {
    auto& metric = sql("SELECT name, value FROM run_metrics WHERE run_id = ?1", run.run.id);
    while (metric.executeStep())
      run.run.metrics[metric.getColumn(0).getString()] = metric.getColumn(1).getDouble();
    metric.reset();
  }
  return rows;
}

}  // namespace

Result<std::vector<RunRow>> LedgerReader::runs(const RunFilter& filter) {
  return guarded(ledger_->database, [&]() -> Result<std::vector<RunRow>> {
    // Conditions that do not hold for this filter are left out, so that SQLite sees which index serves best.
    std::string where = "finished_time_ns >= ?4";
    if (!filter.capture.empty()) where += " AND capture = ?1";
    if (!filter.rig_id.empty()) where += " AND rig_id = ?2";
    if (!filter.solver.empty()) where += " AND solver = ?3";
    if (filter.inputs) where += " AND inputs = ?5";
    const std::string text =
        "SELECT record, committed_time_ns FROM runs WHERE rowid IN (SELECT rowid FROM runs WHERE " + where +
        " ORDER BY committed_time_ns DESC LIMIT ?6) ORDER BY capture, first_idx, inputs, committed_time_ns";
    auto& row = ledger_->sql(text.c_str(), filter.capture, filter.rig_id, filter.solver, filter.since_ns,
                             filter.inputs, filter.limit);
    return read_runs(row, ledger_->sql);
  });
}

Result<RunRow> LedgerReader::run(const std::string& run_id) {
  return guarded(ledger_->database, [&]() -> Result<RunRow> {
    auto rows = read_runs(ledger_->sql("SELECT record, committed_time_ns FROM runs WHERE id = ?1", run_id),
                          ledger_->sql);
    if (!rows) return tl::unexpected(rows.error());
    if (rows->empty()) return unknown("run", run_id);
    return std::move(rows->front());
  });
}

Result<std::vector<JobRow>> LedgerReader::jobs(std::optional<JobState> state) {
  return guarded(ledger_->database, [&]() -> Result<std::vector<JobRow>> {
    std::vector<JobRow> rows;
    auto& row = ledger_->sql(
        "SELECT id, run_id, state, attempt, worker, reason FROM jobs WHERE ?1 IS NULL OR state = ?1 ORDER BY "
        "id",
        state ? std::optional(name_of(*state)) : std::nullopt);
    while (row.executeStep())
      rows.push_back({row.getColumn(0).getInt64(), row.getColumn(1).getString(),
                      job_state_from_name(row.getColumn(2).getString()).value_or(JobState::Failed),
                      row.getColumn(3).getInt(), row.getColumn(4).getString(), row.getColumn(5).getString()});
    row.reset();
    return rows;
  });
}

Result<Rig> LedgerReader::rig(const std::string& rig_id) {
  return guarded(ledger_->database, [&]() -> Result<Rig> {
    auto& row = ledger_->sql("SELECT record FROM rigs WHERE id = ?1", rig_id);
    if (!row.executeStep()) return unknown("rig", rig_id);
    auto record = record_of<PutRig>(row.getColumn(0));
    row.reset();
    if (!record) return tl::unexpected(record.error());
    return std::move(record->rig);
  });
}

Result<std::vector<Calibration>> LedgerReader::calibrations() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<Calibration>> {
    std::vector<Calibration> all;
    auto& row = ledger_->sql("SELECT record FROM calibrations ORDER BY version");
    while (row.executeStep()) {
      auto record = record_of<PutCalibration>(row.getColumn(0));
      if (!record) {
        row.reset();
        return tl::unexpected(record.error());
      }
      all.push_back(std::move(record->calibration));
    }
    row.reset();
    return all;
  });
}

Result<PutCalibration> LedgerReader::calibration(std::int64_t version) {
  return guarded(ledger_->database, [&]() -> Result<PutCalibration> {
    auto& row = ledger_->sql("SELECT record FROM calibrations WHERE version = ?1", version);
    if (!row.executeStep()) return unknown("calibration", concat("version ", version));
    auto record = record_of<PutCalibration>(row.getColumn(0));
    row.reset();
    return record;
  });
}

Result<std::vector<Event>> LedgerReader::events(std::int64_t limit) {
  return guarded(ledger_->database, [&]() -> Result<std::vector<Event>> {
    std::vector<Event> events;
    auto& row =
        ledger_->sql("SELECT time_ns, kind, subject, text FROM events ORDER BY id DESC LIMIT ?1", limit);
    while (row.executeStep())
      events.push_back({row.getColumn(0).getInt64(), row.getColumn(1).getString(),
                        row.getColumn(2).getString(), row.getColumn(3).getString()});
    row.reset();
    return events;
  });
}

// --- receipt

bool Receipt::CameraLine::balances() const {
  std::int64_t lost = 0;
  for (const auto& [cause, count] : losses) lost += count;
  return pulses == frames + lost;
}

bool Receipt::balances() const {
  const bool cameras_balance =
      std::all_of(cameras.begin(), cameras.end(), [](const CameraLine& line) { return line.balances(); });
  return cameras_balance && sets == volumes + failed + pending + not_asked;
}

namespace {

// Pulses that a camera had to deliver: what the array counted once the capture is over, else the sets so far.
void read_cameras(Receipt& receipt, Statements& sql) {
  const bool finished = receipt.capture.finished_time_ns != 0 && receipt.capture.pulses > 0;
  const std::int64_t pulses = finished ? receipt.capture.pulses : receipt.sets;
  std::map<std::string, Receipt::CameraLine> lines;
  for (const std::string& camera : receipt.capture.cameras) lines[camera];
  auto& row =
      sql("SELECT camera, loss, count(*) FROM frames JOIN sets ON sets.id = set_id WHERE capture = ?1 "
          "GROUP BY camera, loss",
          receipt.capture.id);
  while (row.executeStep()) {
    Receipt::CameraLine& line = lines[row.getColumn(0).getString()];
    const std::int64_t count = row.getColumn(2).getInt64();
    if (row.getColumn(1).isNull())
      line.frames = count;
    else
      line.losses[row.getColumn(1).getString()] = count;
  }
  row.reset();
  auto& counter =
      sql("SELECT camera, name, value FROM capture_counters WHERE capture = ?1", receipt.capture.id);
  while (counter.executeStep())
    lines[counter.getColumn(0).getString()].counters[counter.getColumn(1).getString()] =
        counter.getColumn(2).getInt64();
  counter.reset();
  if (receipt.capture.end == CaptureEnd::Interrupted)
    receipt.sets_not_stored = std::max<std::int64_t>(pulses - receipt.sets, 0);
  for (auto& [camera, line] : lines) {
    line.camera = camera;
    line.pulses = pulses;
    if (receipt.sets_not_stored > 0) line.losses["not-stored"] = receipt.sets_not_stored;
    receipt.cameras.push_back(line);
  }
}

// Each set counts once, by the best that became of its own jobs.
void read_sets(Receipt& receipt, Statements& sql) {
  auto& row =
      sql("SELECT coalesce(max(CASE j.state WHEN 'done' THEN 3 WHEN 'queued' THEN 2 WHEN 'leased' THEN 2 "
          "WHEN 'failed' THEN 1 END), 0) "
          "FROM sets s LEFT JOIN job_inputs i ON i.set_id = s.id LEFT JOIN jobs j ON j.id = i.job_id AND "
          "(SELECT count(*) FROM job_inputs o WHERE o.job_id = j.id) = 1 "
          "WHERE s.capture = ?1 GROUP BY s.id",
          receipt.capture.id);
  while (row.executeStep()) {
    ++receipt.sets;
    switch (row.getColumn(0).getInt()) {
      case 3:
        ++receipt.volumes;
        break;
      case 2:
        ++receipt.pending;
        break;
      case 1:
        ++receipt.failed;
        break;
      default:
        ++receipt.not_asked;
    }
  }
  row.reset();
}

}  // namespace

Result<Receipt> LedgerReader::receipt(const std::string& capture) {
  return guarded(ledger_->database, [&]() -> Result<Receipt> {
    SQLite::Transaction snapshot(ledger_->database);  // all counts from one moment
    Receipt receipt;
    static const std::string kQuestion =
        concat("SELECT ", kCaptureColumns, " FROM captures c WHERE c.id = ?1");
    auto& row = ledger_->sql(kQuestion.c_str(), capture);
    if (!row.executeStep()) return unknown("capture", capture);
    receipt.capture = capture_of(row);
    row.reset();
    read_sets(receipt, ledger_->sql);
    read_cameras(receipt, ledger_->sql);
    auto& failed = ledger_->sql(
        "SELECT DISTINCT run_id, reason FROM jobs j JOIN job_inputs i ON i.job_id = j.id JOIN sets s ON s.id "
        "= "
        "i.set_id WHERE s.capture = ?1 AND j.state = 'failed' ORDER BY j.id",
        capture);
    while (failed.executeStep())
      receipt.failures.push_back({failed.getColumn(0).getString(), failed.getColumn(1).getString()});
    failed.reset();
    auto& combined = ledger_->sql("SELECT count(*) FROM runs WHERE capture = ?1 AND inputs > 1", capture);
    if (combined.executeStep()) receipt.combined_volumes = combined.getColumn(0).getInt64();
    combined.reset();
    return receipt;
  });
}

}  // namespace flamefield
