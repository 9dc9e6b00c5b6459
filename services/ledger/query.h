#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "proto/job.h"
#include "proto/upkeep.h"
#include "services/ledger/filter.h"

namespace flamefield {

struct ReadOnlyLedger;

// Work that was asked for, done or not. Of work that is not done, `run` holds what is known beforehand.
struct WorkRow {
  Run run;
  JobState state = JobState::Done;
  std::string reason;  // of the last failure
  std::int64_t committed_time_ns = 0;
  bool stale = false;
  bool retired = false;           // its files were removed; they can be made again
  std::vector<std::string> tags;  // of the run and of its capture
};

// A calibration that counts since a time, and what it makes stale.
struct AcceptedRigRow {
  std::string rig_id;
  std::int64_t accepted_time_ns = 0;
  std::int64_t since_ns = 0;
  double rms_px = 0;  // NaN: not from a calibration
};

struct ScheduleRow {
  Schedule schedule;
  std::int64_t jobs_left = 0;           // of its last runs, not yet done
  std::int64_t last_run_ns = 0;         // 0: never
  std::string last_outcome, last_text;  // of the newest due time
};

// What recorded work took, for estimates.
struct PastWork {
  std::int64_t runs = 0;
  double seconds = 0;       // median of fetch, prepare, solve and write together
  double peak_rss_mib = 0;  // the most seen
};

// Selects by the filter language. Looks into a ledger that another process may be writing; one thread.
class LedgerQuery {
 public:
  // NotFound when there is no ledger yet; InvalidInput when it is of another version.
  static Result<LedgerQuery> open(const std::filesystem::path& directory);
  LedgerQuery(LedgerQuery&&) noexcept;
  ~LedgerQuery();

  // Newest first. A filter of FilterOver::Runs.
  Result<std::vector<WorkRow>> work(const Filter& filter, std::int64_t limit);
  Result<WorkRow> run(const std::string& run_id);  // NotFound: no such run is done
  Result<std::int64_t> count_work(const Filter& filter);
  // In the order of captures and indices. A filter of FilterOver::Sets.
  Result<std::vector<SetId>> sets(const Filter& filter);

  Result<std::optional<Processing>> newest_processing();  // of the newest run, else of the live plan
  Result<bool> has_work(const Job& job);                  // identical work is done, running or waiting
  Result<PastWork> past_work(const std::string& solver, const Grid& grid);
  Result<std::vector<AcceptedRigRow>> accepted_rigs();          // newest first
  Result<std::optional<std::string>> rig_for(const SetId& id);  // the accepted one that counts for it
  Result<std::vector<ScheduleRow>> schedules();                 // by name

 private:
  explicit LedgerQuery(std::unique_ptr<ReadOnlyLedger> ledger);
  std::unique_ptr<ReadOnlyLedger> ledger_;
};

}  // namespace flamefield
