#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "services/study/record.h"
#include "services/study/scene.h"
#include "services/study/sweep.h"

namespace flamefield {

struct RunEstimate {
  const StudyRun* run = nullptr;
  bool is_done = false, is_twin = false;  // its equal comes before it
  double seconds = 0;                     // of one core; NaN: not known
};

// What every run would take, without doing it: one short trial for each phantom and solver, scaled to the
// iterations of the run. `progress` hears each trial.
Result<std::vector<RunEstimate>> estimate_runs(const std::vector<Study>& studies, const StudyPlan& plan,
                                               const RecordStore* store, StudyScenes& scenes,
                                               std::stop_token stop,
                                               const std::function<void(const std::string&)>& progress);

}  // namespace flamefield
