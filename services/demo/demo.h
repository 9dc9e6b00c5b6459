#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>

#include "proto/error.h"
#include "proto/frame.h"
#include "proto/recipe.h"

namespace flamefield {

// The main job on a simulated laboratory: calibration session, dark, background and flat frames, a burst of
// an evolving flame, reconstruction of every pulse and of the mean, comparison with the known flame, report.
struct DemoOptions {
  std::filesystem::path out = "flamefield-demo";
  int cameras = 15;
  int poses = 24;             // of the calibration board
  int pulses = 30;            // of the burst
  int reference_pulses = 10;  // of dark, background and flat, each
  double rate_hz = 5;
  PixelFormat pixel_format = PixelFormat::Mono8;
  std::optional<std::filesystem::path> flame;  // a .npy or .vtkhdf field to show in place of the phantom
  double flame_spacing_mm = 0;                 // of a .npy
  double voxel_mm = 1.32;                      // of the reconstruction
  Recipe recipe;
  std::uint64_t seed = 1;
  std::string first_address = "127.0.0.2";  // of the simulated cameras
  int http_port = 8080;                     // of the live page; 0: none
};

// Everything that summary.json holds.
struct DemoSummary {
  std::int64_t pulses = 0, sets = 0, volumes = 0;  // of the burst; volumes: one a set
  double calibration_rms_px = 0;
  double volume_error_mean_px = 0, volume_error_worst_px = 0;
  std::string volume_error_worst_camera;
  double pearson_mean = 0, pearson_worst = 0, sqmd_mean = 0;  // over the pulses
  double pearson_of_mean = 0, sqmd_of_mean = 0;               // of the mean image's volume
  double pulse_to_set_p99_ms = 0;
  double set_to_volume_p99_ms = 0;
  double job_wall_s = 0;
};

struct DemoProgress {
  std::function<void(const std::string& stage, std::int64_t done, std::int64_t total)> step;
};

// Files: out/summary.json, out/report.html, out/rig.yaml, out/true-rig.yaml, out/data/ (ledger, spool,
// volumes). `when_done` runs while the services are still up, e.g. to keep the live page for a while.
Result<DemoSummary> run_demo(
    const DemoOptions& options, const DemoProgress& progress, std::stop_token stop,
    const std::function<void(const DemoSummary&, const std::string& page_url)>& when_done);

}  // namespace flamefield
