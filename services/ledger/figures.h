#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "proto/job.h"

namespace flamefield {

// What the ledger knows about how the work goes, for monitoring. Cheap: it looks at indices and at the newest
// rows.
struct LedgerFigures {
  std::map<std::pair<Priority, JobState>, std::int64_t> jobs;  // in line, and worked on
  double oldest_waiting_s = 0;                                 // job in line; 0: none
  std::vector<double> pulse_to_volume_s;                       // of the newest live runs, sorted
  std::vector<double> set_to_stored_s;                         // of the newest sets, sorted
  std::map<std::string, std::vector<double>>
      stage_s;  // queue, fetch, prepare, solve, write; of the newest runs, sorted
  std::map<std::string, std::int64_t> schedule_outcomes;
  std::int64_t artefacts = 0, artefact_bytes = 0, retired = 0;
};

// NotFound: there is no ledger yet.
Result<LedgerFigures> ledger_figures(const std::filesystem::path& directory, std::int64_t now_ns);

}  // namespace flamefield
