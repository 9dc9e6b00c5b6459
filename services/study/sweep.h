#pragma once

#include <vector>

#include "services/study/study.h"

namespace flamefield {

struct StudyPlan {
  std::vector<StudyRun> runs;
  std::vector<std::string> notes;  // e.g. runs that are the same as others and are done once
};

// All runs of all studies, each checked. InvalidInput names the run whose settings are at fault.
Result<StudyPlan> plan_runs(const std::vector<Study>& studies, FieldFiles& fields);

}  // namespace flamefield
