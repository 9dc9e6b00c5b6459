#pragma once

#include <filesystem>

#include "services/worker/worker.h"

namespace flamefield {

struct ReconstructJobOptions {
  std::filesystem::path data_dir;  // volumes/ in it
  int threads = 0;                 // 0: all
};

// The step that makes volumes: fetch and average the sets, prepare, solve, write volume and projections.
// References and the last projectors are kept from job to job. For one worker.
JobStep make_reconstruct_step(const ReconstructJobOptions& options);

}  // namespace flamefield
