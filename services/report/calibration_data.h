#pragma once

#include "calibrate/calibrate.h"
#include "services/report/report.h"

namespace flamefield {

// What a calibration found, as the report shows it. The true rig and the error against it are the caller's.
ReportCalibration report_calibration(const CalibrationReport& found);

}  // namespace flamefield
