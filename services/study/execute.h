#pragma once

#include <functional>
#include <stop_token>

#include "services/study/record.h"
#include "services/study/scene.h"
#include "services/study/study.h"

namespace flamefield {

struct Executed {
  RunRecord record;
  Volume volume;
};

// Does one run on a scene made before. Its figures depend on its settings alone, not on `threads`, unless it
// has a time limit. Unavailable when it was stopped: half a run says nothing.
Result<Executed> execute(const StudyRun& run, const StudyScene& scene, int threads, std::stop_token stop,
                         const std::function<void(double share)>& progress);

}  // namespace flamefield
