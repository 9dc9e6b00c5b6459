#pragma once

#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "calibrate/calibrate.h"
#include "calibrate/check.h"
#include "calibrate/compare.h"
#include "proto/calibration.h"
#include "services/calibration/flame_check.h"

namespace flamefield {

// What calibrations say, as JSON.
std::string json_text(const CalibrationReport& report);
std::string json_text(const CheckReport& report);
std::string json_text(const FlameCheck& check);
std::string json_text(const CalibrationState& state);
std::string json_text(const Calibration& accepted);

// What a report states beside the solution itself.
struct CalibrationContext {
  BoardSpec board;
  std::string command_line;
  std::optional<RigComparison> comparison = {};
  std::string compared_with = {};         // e.g. "calibration 3"
  std::span<const BoardView> views = {};  // what was looked at; those that fit worst are shown
};

// calibration.json and report.html in `folder`, which must exist.
Result<> write_calibration_report(const std::filesystem::path& folder, const CalibrationReport& report,
                                  const CalibrationContext& context);

// "0.0123 deg, 0.045 mm, 0.008 px in the volume", or why there is none.
std::string split_half_text(const CalibrationReport& report);

}  // namespace flamefield
