#include "services/ledger/run_list.h"

#include "services/ledger/read_only.h"

namespace flamefield {

RunList::RunList(std::unique_ptr<ReadOnlyLedger> ledger) : ledger_(std::move(ledger)) {}
RunList::RunList(RunList&&) noexcept = default;
RunList::~RunList() = default;

Result<RunList> RunList::open(const std::filesystem::path& directory) {
  return open_read_only(directory).map(
      [](std::unique_ptr<ReadOnlyLedger> ledger) { return RunList(std::move(ledger)); });
}

namespace {

constexpr const char* kConditions =
    " FROM runs WHERE (?1 = '' OR instr(lower(id), lower(?1)) > 0 OR instr(lower(worker), lower(?1)) > 0) "
    "AND "
    "(?2 = '' OR capture = ?2) AND (?3 = '' OR solver = ?3) AND (?4 = '' OR rig_id = ?4)";

// The columns of a table, never text from outside.
std::string order_by(const RunQuery& query) {
  const char* direction = query.is_descending ? " DESC" : "";
  switch (query.order) {
    case RunOrder::Finished:
      break;
    case RunOrder::Capture:
      return concat(" ORDER BY capture", direction, ", first_idx", direction, ", id");
    case RunOrder::Solver:
      return concat(" ORDER BY solver", direction, ", id");
    case RunOrder::Residual:
      return concat(" ORDER BY residual", direction, ", id");
    case RunOrder::Duration:
      return concat(" ORDER BY finished_time_ns - started_time_ns", direction, ", id");
    case RunOrder::Size:
      return concat(" ORDER BY volume_bytes", direction, ", id");
  }
  return concat(" ORDER BY finished_time_ns", direction, ", id", direction);
}

}  // namespace

Result<RunPage> RunList::page(const RunQuery& q) {
  return guarded(ledger_->database, [&]() -> Result<RunPage> {
    SQLite::Transaction snapshot(ledger_->database);  // the total and the lines of one moment
    RunPage page;
    const std::string counted = concat("SELECT count(*)", kConditions);
    auto& count = ledger_->sql(counted.c_str(), q.search, q.capture, q.solver, q.rig_id);
    if (count.executeStep()) page.total = count.getColumn(0).getInt64();
    count.reset();
    const std::string listed = concat(
        "SELECT id, capture, first_idx, inputs, solver, worker, rig_id, iterations, residual, volume_bytes, "
        "started_time_ns, finished_time_ns",
        kConditions, order_by(q), " LIMIT ?5 OFFSET ?6");
    auto& row = ledger_->sql(listed.c_str(), q.search, q.capture, q.solver, q.rig_id, q.limit, q.offset);
    while (row.executeStep()) {
      RunLine line;
      line.id = row.getColumn(0).getString();
      line.capture = row.getColumn(1).getString();
      line.first_index = row.getColumn(2).getInt64();
      line.inputs = row.getColumn(3).getInt64();
      line.solver = row.getColumn(4).getString();
      line.worker = row.getColumn(5).getString();
      line.rig_id = row.getColumn(6).getString();
      line.iterations = row.getColumn(7).getInt64();
      line.residual = row.getColumn(8).getDouble();
      line.volume_bytes = row.getColumn(9).getInt64();
      line.started_time_ns = row.getColumn(10).getInt64();
      line.finished_time_ns = row.getColumn(11).getInt64();
      page.lines.push_back(std::move(line));
    }
    row.reset();
    return page;
  });
}

Result<std::vector<std::string>> RunList::solvers() {
  return guarded(ledger_->database, [&]() -> Result<std::vector<std::string>> {
    std::vector<std::string> names;
    auto& row = ledger_->sql("SELECT DISTINCT solver FROM recipes ORDER BY solver");
    while (row.executeStep()) names.push_back(row.getColumn(0).getString());
    row.reset();
    return names;
  });
}

Result<JobPage> RunList::jobs(std::int64_t first, std::int64_t last, std::int64_t limit) {
  return guarded(ledger_->database, [&]() -> Result<JobPage> {
    SQLite::Transaction snapshot(ledger_->database);
    JobPage page;
    auto& counted = ledger_->sql(
        "SELECT coalesce(sum(state = 'queued'), 0), coalesce(sum(state = 'leased'), 0), "
        "coalesce(sum(state = 'done'), 0), coalesce(sum(state = 'failed'), 0) FROM jobs WHERE id BETWEEN ?1 "
        "AND ?2",
        first, last);
    if (counted.executeStep()) {
      page.queued = counted.getColumn(0).getInt64();
      page.leased = counted.getColumn(1).getInt64();
      page.done = counted.getColumn(2).getInt64();
      page.failed = counted.getColumn(3).getInt64();
    }
    counted.reset();
    auto& row = ledger_->sql(
        "SELECT id, run_id, state, attempt, worker, reason FROM jobs WHERE id BETWEEN ?1 AND ?2 "
        "ORDER BY id DESC LIMIT ?3",
        first, last, limit);
    while (row.executeStep())
      page.lines.push_back({row.getColumn(0).getInt64(), row.getColumn(1).getString(),
                            row.getColumn(2).getString(), row.getColumn(4).getString(),
                            row.getColumn(5).getString(), row.getColumn(3).getInt()});
    row.reset();
    return page;
  });
}

Result<std::int64_t> RunList::pulse_time_ns(const std::string& capture, std::int64_t index) {
  return guarded(ledger_->database, [&]() -> Result<std::int64_t> {
    auto& row =
        ledger_->sql("SELECT pulse_time_ns FROM sets WHERE capture = ?1 AND idx = ?2", capture, index);
    const std::int64_t time_ns = row.executeStep() ? row.getColumn(0).getInt64() : 0;
    row.reset();
    return time_ns;
  });
}

}  // namespace flamefield
