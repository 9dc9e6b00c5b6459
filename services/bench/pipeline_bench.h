#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>

#include "proto/error.h"
#include "proto/recipe.h"

namespace flamefield {

struct PipelineOptions {
  int cameras = 15;
  int image_width_px = 659, image_height_px = 494;
  int nx = 52, ny = 55, nz = 52;  // voxels of the reconstruction
  int sets = 20;
  int durable_sets = 120;  // for the measurement against the disk
  int workers = 1;
  int threads = 0;  // of each worker
  Recipe recipe;
  std::filesystem::path data_dir;  // an empty folder on the disk that is to be measured
};

// Means over the sets unless said.
struct PipelineMeasurement {
  double set_mib = 0;
  double sets_per_s = 0;  // put and acknowledged, one after the other: each is on the disk by then
  double put_p99_ms = 0;
  // The ceiling: sets offered as fast as they are taken, and what the disk does with as many bytes written
  // one after the other into a preallocated file, one fdatasync a set; in turns, in the same run.
  double durable_sets_per_s = 0, disk_sets_per_s = 0;
  double volumes_per_s = 0;  // from the order to the last commit
  double cpu_s_per_volume = 0;
  double fetch_ms = 0, prepare_ms = 0, solve_ms = 0, write_ms = 0;
  double first_prepare_ms = 0, first_solve_ms = 0;  // with maps and projector to be made
  int failed = 0;
};

// Spool, ledger, dispatcher and workers in this process, on frame sets of a rendered flame. `progress` hears
// each stage. Unavailable when stopped or when nothing moves for a minute.
Result<PipelineMeasurement> measure_pipeline(const PipelineOptions& options, std::stop_token stop,
                                             const std::function<void(const std::string&)>& progress);

}  // namespace flamefield
