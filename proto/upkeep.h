#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

// What keeps the books in order: tags, accepted calibrations, schedules, retention.
namespace flamefield {

struct PutTags {        // -> Accepted; NotFound: no such run or capture
  std::string subject;  // a run or a capture
  std::vector<std::string> add, remove;
};

// From now on this rig is the calibration of everything taken since `since_ns`: volumes made before with
// another one are stale.
struct AcceptRig {  // -> Accepted; NotFound: the rig was not stored
  std::string rig_id;
  std::int64_t since_ns = 0;  // UTC; 0: everything
};

// Which recorded work is to be done again, and what changes. Evaluated when it is due, not when it is
// written.
struct ReprocessOrder {
  std::string where;                  // in the filter language of services/ledger; empty: all bursts
  bool stale = false;                 // only what a newer calibration made stale, and with that calibration
  std::string rig_id;                 // in place of each run's own; empty: as it was
  std::string recipe;                 // TOML in place of each run's own; empty: as it was
  std::vector<std::string> settings;  // "table.key=value", laid over the recipe
  std::vector<std::string> sweep;     // "table.key=a,b,c": once for each value, and each combination
};

enum class MissedRuns { Once, Skip };    // of a time at which the service was down
enum class OverlapRuns { Skip, Queue };  // while the last run's jobs are not done
std::string_view name_of(MissedRuns policy);
std::string_view name_of(OverlapRuns policy);
std::optional<MissedRuns> missed_runs_from_name(std::string_view name);
std::optional<OverlapRuns> overlap_runs_from_name(std::string_view name);

struct Schedule {
  std::string name;
  std::string cron;          // five fields, see services/scheduler/cron.h
  std::string zone = "UTC";  // of the IANA time zone database, e.g. "Asia/Tokyo"
  MissedRuns missed = MissedRuns::Once;
  OverlapRuns overlap = OverlapRuns::Skip;
  ReprocessOrder order;
  std::int64_t created_time_ns = 0;
  std::int64_t last_due_ns = 0;  // everything up to here was dealt with; 0: nothing yet
};
struct PutSchedule {  // -> Accepted; replaces one of the same name
  Schedule schedule;
};
struct DropSchedule {  // -> Accepted; NotFound
  std::string name;
};
struct ScheduleRan {  // -> Accepted; what became of a due time
  std::string name;
  std::int64_t due_ns = 0;
  std::int64_t time_ns = 0;
  std::string outcome;  // submitted, missed, overlapped, failed
  std::string text;
  std::vector<std::int64_t> job_ids;
};

// Their files are removed; all of these runs can be made again, and their records stay.
struct Retire {  // -> Accepted; InvalidInput: one of them could not be made again
  std::vector<std::string> run_ids;
};

}  // namespace flamefield
