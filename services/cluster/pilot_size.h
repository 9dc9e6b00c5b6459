#pragma once

#include <cstdint>

#include "proto/error.h"
#include "services/config/lab_config.h"

namespace flamefield {

// The work that pilots are hired for, as far as it is foreseen.
struct PilotWork {
  std::int64_t volumes = 0;
  double seconds = 0;       // of one worker for all of it; 0: unknown
  double peak_rss_mib = 0;  // of a worker; 0: unknown
};

// What is asked of Slurm.
struct PilotSize {
  int pilots = 1, cores = 1;
  std::int64_t memory_mib = 0;
  int minutes = 0;          // 0: as the partition says
  double seconds_left = 0;  // work that will not fit into the time limits: to be submitted for again
};

// As many pilots as [cluster] allows, but none with less than a few minutes of work; a time limit of half as
// much again as the estimate, since machines differ, and its time to drain; memory of a quarter more than the
// most that was seen. What the configuration names, it decides.
PilotSize size_pilots(const PilotWork& work, const ClusterConfig& config);

}  // namespace flamefield
