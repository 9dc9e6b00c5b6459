#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"
#include "proto/rig.h"
#include "proto/volume.h"
#include "reconstruct/metrics.h"

namespace flamefield {

// A number that was not measured. The report prints a dash for it.
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// One camera's picture before and after preparation.
struct ReportImages {
  std::string camera;
  Image raw;              // grey levels of the sensor
  double full_scale = 0;  // grey level of a saturated pixel; 0: the brightest pixel of all cameras
  Image prepared;         // field unit x mm; may be empty
};

// What became of one pulse. Unknown where it was not measured or the volume was not made.
struct ReportPulse {
  std::int64_t pulse = 0;
  double pearson = kUnknown;
  double sqmd = kUnknown;
  double residual = kUnknown;  // |Ax - b| / |b|
  double pulse_to_set_ms = kUnknown;
  double set_to_volume_ms = kUnknown;
};

// A volume of the film strip.
struct ReportFrame {
  std::int64_t pulse = 0;
  Volume volume;
};

// The reconstruction that the figures show, and the truth if it is known (same grid).
struct ReportField {
  std::string label;  // e.g. "pulse 17" or "mean of 30 pulses"
  Volume volume;
  std::optional<Volume> truth;
  std::optional<FieldMetrics> metrics;
  std::vector<std::string> view_names;
  std::vector<double> residual_per_view;  // |Ax - b| / |b|
  struct Step {
    int iteration = 0;
    double residual = 0;
  };
  std::vector<Step> history;
};

struct CalibrationReport;  // calibrate/calibrate.h
struct RigComparison;      // calibrate/compare.h

// A picture of the board, and the session's view that belongs to it by camera and pose.
struct ReportOverlay {
  std::string camera, pose;
  Image image;  // grey levels on any scale
};

struct ReportCalibration {
  Rig rig;                                 // as estimated, with its quality
  std::optional<Rig> true_rig;             // of a simulated array, same names
  double volume_error_mean_px = kUnknown;  // reprojection of the measuring volume, estimated against true rig
  double volume_error_worst_px = kUnknown;
  std::string volume_error_worst_camera;
  double expected_error_mean_px = kUnknown;  // the same, as the covariance of the adjustment foresees it
  double expected_error_worst_px = kUnknown;
  std::string expected_error_worst_camera = {};
  std::vector<std::vector<double>> rms_px;  // (cameras, poses); unknown where a camera did not see the board
  std::vector<float> residuals_px;          // x and y of every corner
  std::shared_ptr<const CalibrationReport> session = {};  // the session behind it, picture by picture
  std::shared_ptr<const RigComparison> comparison = {};   // against an earlier calibration,
  std::string compared_with = {};                         // and which
  std::vector<ReportOverlay> overlays = {};               // pictures that the report shows with their corners
};

// Pulses seen = frames stored + losses, by name.
struct ReportReceipt {
  std::string camera;
  std::int64_t pulses = 0;
  std::int64_t stored = 0;
  std::map<std::string, std::int64_t> losses;
};

// Everything that a report may show. Parts that are absent (empty) are left out of it.
struct ReportData {
  std::string title = "Flame reconstruction";
  std::string subtitle;  // e.g. "simulated 15-camera array, stratified flame"
  std::string created;   // UTC, as it is to be printed
  std::string unit = "a.u.";
  std::int64_t pulses = 0, sets = 0, volumes = 0;
  double pulse_period_ms = kUnknown;
  double job_wall_s = kUnknown;
  std::vector<ReportImages> images;
  std::vector<std::string> preparation;  // one line a step, with its numbers
  std::vector<ReportFrame> film;
  std::optional<ReportField> field;
  std::optional<ReportCalibration> calibration;
  std::vector<ReportPulse> per_pulse;
  std::vector<ReportReceipt> receipts;
  std::vector<std::pair<std::string, std::string>> parameters;  // versions, recipe, rig, host, seeds
  std::vector<std::string> commands;                            // that do it again
};

// One HTML file that needs nothing else: inline pictures, plots and style, no scripts.
// Unavailable: gnuplot is missing. InvalidInput: grids of truth and volume differ, or the file cannot be
// written.
Result<std::string> report_html(const ReportData& data);
Result<> write_report(const std::filesystem::path& path, const ReportData& data);

}  // namespace flamefield
