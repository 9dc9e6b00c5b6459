#pragma once

#include "calibrate/calibrate.h"

namespace flamefield {

// From the views that a calibration used. What lies outside is extrapolated.
Coverage coverage_of(const CalibrationReport& report, const BoardSpec& board);

}  // namespace flamefield
