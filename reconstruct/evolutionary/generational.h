#pragma once

#include "reconstruct/evolutionary/ert.h"
#include "reconstruct/evolutionary/model.h"

namespace flamefield {

// The paper's scheme to the letter: Algorithms 1 to 4, every chromosome a whole field with its images. That
// images follow from those of the parents is a saving, not a change (while the model is linear).
Result<Solution> evolve_generations(const Problem& problem, const ErtOptions& options,
                                    const MeasurementModel& model, float scale);

}  // namespace flamefield
