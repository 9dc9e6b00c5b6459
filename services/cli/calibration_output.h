#pragma once

#include <filesystem>
#include <string>

#include "calibrate/calibrate.h"
#include "calibrate/check.h"
#include "services/cli/app.h"

namespace flamefield {

// What `calibrate` says: JSON, a table on stdout, and the page of --report.
std::string json_text(const CalibrationReport& report);
std::string json_text(const CheckReport& report);
void print(const CalibrationReport& report, const std::filesystem::path& rig);
void print(const CheckReport& report);

// calibration.json and report.html in `folder`, which must exist.
Result<> write_calibration_report(const std::filesystem::path& folder, const CalibrationReport& report,
                                  const BoardSpec& board, const std::string& command_line);

}  // namespace flamefield
