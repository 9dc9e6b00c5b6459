#pragma once

#include <filesystem>
#include <string>

#include "calibrate/calibrate.h"
#include "calibrate/check.h"
#include "calibrate/compare.h"
#include "services/calibration/flame_check.h"

namespace flamefield {

// What `calibrate` prints: tables on stdout.
void print(const CalibrationReport& report, const std::filesystem::path& rig);
void print(const CheckReport& report);
void print(const FlameCheck& check);
void print(const RigComparison& comparison, const std::string& with);

}  // namespace flamefield
