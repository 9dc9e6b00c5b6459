#include "services/ledger/figures.h"

#include <algorithm>

#include "services/ledger/read_only.h"

namespace flamefield {

namespace {

constexpr int kNewest = 200;

double seconds(std::int64_t span_ns) {
  return static_cast<double>(span_ns) * 1e-9;
}

void read_jobs(Statements& sql, LedgerFigures& figures, std::int64_t now_ns) {
  auto& row =
      sql("SELECT priority, state, count(*) FROM jobs WHERE state IN ('queued', 'leased') GROUP BY priority, "
          "state");
  while (row.executeStep())
    figures.jobs[{static_cast<Priority>(row.getColumn(0).getInt()),
                  job_state_from_name(row.getColumn(1).getString()).value_or(JobState::Failed)}] +=
        row.getColumn(2).getInt64();
  row.reset();
  auto& oldest =
      sql("SELECT created_time_ns FROM jobs WHERE id = (SELECT min(id) FROM jobs WHERE state = 'queued')");
  if (oldest.executeStep())
    figures.oldest_waiting_s = std::max(0.0, seconds(now_ns - oldest.getColumn(0).getInt64()));
  oldest.reset();
}

void read_latencies(Statements& sql, LedgerFigures& figures) {
  auto& run =
      sql("SELECT r.finished_time_ns - s.pulse_time_ns, j.priority, r.queue_s, r.fetch_s, r.prepare_s, "
          "r.solve_s, "
          "r.write_s FROM runs r JOIN jobs j ON j.id = r.job_id LEFT JOIN sets s ON s.capture = r.capture "
          "AND s.idx = "
          "r.first_idx ORDER BY r.committed_time_ns DESC LIMIT ?1",
          kNewest);
  while (run.executeStep()) {
    if (run.getColumn(1).getInt() == static_cast<int>(Priority::Live))
      figures.pulse_to_volume_s.push_back(seconds(run.getColumn(0).getInt64()));
    int column = 2;
    for (const char* stage : {"queue", "fetch", "prepare", "solve", "write"})
      figures.stage_s[stage].push_back(run.getColumn(column++).getDouble());
  }
  run.reset();
  auto& set = sql("SELECT stored_time_ns - complete_time_ns FROM sets ORDER BY id DESC LIMIT ?1", kNewest);
  while (set.executeStep()) figures.set_to_stored_s.push_back(seconds(set.getColumn(0).getInt64()));
  set.reset();
  std::ranges::sort(figures.pulse_to_volume_s);
  std::ranges::sort(figures.set_to_stored_s);
  for (auto& [stage, values] : figures.stage_s) std::ranges::sort(values);
}

void read_upkeep(Statements& sql, LedgerFigures& figures) {
  auto& outcome = sql("SELECT outcome, count(*) FROM schedule_runs GROUP BY outcome");
  while (outcome.executeStep())
    figures.schedule_outcomes[outcome.getColumn(0).getString()] = outcome.getColumn(1).getInt64();
  outcome.reset();
  auto& files =
      sql("SELECT count(*) FILTER (WHERE retired_time_ns = 0), coalesce(sum(bytes) FILTER (WHERE "
          "retired_time_ns = 0), "
          "0), count(*) FILTER (WHERE retired_time_ns > 0) FROM artefacts");
  files.executeStep();
  figures.artefacts = files.getColumn(0).getInt64();
  figures.artefact_bytes = files.getColumn(1).getInt64();
  figures.retired = files.getColumn(2).getInt64();
  files.reset();
}

}  // namespace

Result<LedgerFigures> ledger_figures(const std::filesystem::path& directory, std::int64_t now_ns) {
  const auto ledger = open_read_only(directory);
  if (!ledger) return tl::unexpected(ledger.error());
  return guarded((*ledger)->database, [&]() -> Result<LedgerFigures> {
    Statements& sql = (*ledger)->sql;
    LedgerFigures figures;
    read_jobs(sql, figures, now_ns);
    read_latencies(sql, figures);
    read_upkeep(sql, figures);
    return figures;
  });
}

}  // namespace flamefield
