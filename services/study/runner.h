#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <stop_token>
#include <string>
#include <vector>

#include "services/study/execute.h"
#include "services/study/sweep.h"

namespace flamefield {

struct RunnerOptions {
  int jobs = 0;  // runs at a time; 0: one a core
  std::function<void(double done, double total, double eta_s, const std::string& last)> progress = {};
};

struct RunFailure {
  std::string label;
  Error error;
};
struct RunnerSummary {
  std::size_t skipped = 0, done = 0;
  std::vector<RunFailure> failures;  // runs that could not be done; the others were
  bool stopped = false;
};

// Does the runs of a plan that the store does not know yet, several at a time, and stores each as soon as it
// is finished. A failed run leaves the others alone, but a store that cannot be written ends all.
Result<RunnerSummary> do_runs(const std::vector<Study>& studies, const StudyPlan& plan,
                              const RecordStore& store, StudyScenes& scenes, const RunnerOptions& options,
                              std::stop_token stop);

// Whether nothing is left to do for a run.
bool is_done(const Study& study, const StudyRun& run, const RecordStore& store);

}  // namespace flamefield
