#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/message.h"
#include "services/cluster/pilot_size.h"
#include "services/cluster/slurm.h"
#include "services/config/lab_config.h"

namespace flamefield {

// Where pilots come from and go to.
struct ClusterPlace {
  std::filesystem::path data_dir, keys_dir;  // the dispatcher's
  std::filesystem::path shared_dir;          // as the nodes see it; pilots/ and volumes/ in it
  std::filesystem::path worker;              // the program on the nodes
  std::string endpoint;                      // of the dispatcher, as the nodes see it
  ClusterConfig config;
};

// InvalidInput: no address that nodes could reach, or the shared directory does not hold the volumes.
Result<ClusterPlace> cluster_place(const LabConfig& lab);

// Pilots that were submitted together. The name is ours: it names the array in Slurm, its directory, its key
// on the allow-list, and (with "-TASK" after it) its workers.
struct Hired {
  std::string name;
  std::filesystem::path directory;
  bool live = false;             // they take live work alone
  std::vector<SlurmJob> pilots;  // that Slurm knows
  bool is_alive() const;
};

// Makes a directory and a key for the pilots, lets the key in, and submits. `live`: into the live partition,
// for live work alone, without end. NotFound: no sbatch, or no such partition. InvalidInput: refused. After
// an error nothing is left behind.
Result<Hired> hire(const ClusterPlace& place, const PilotSize& size, bool live);

// All that have a directory, the newest last.
Result<std::vector<Hired>> all_hired(const ClusterPlace& place);

// Now: jobs in hand are given back. Drain: they are finished, and those that wait in Slurm are taken back.
Result<> dismiss(const Hired& hired, bool drain);

// Are they gone? Neither Slurm nor the dispatcher knows one that lives: a controller that lost its state
// forgets jobs that run on, and a worker that is cut off is in Slurm's list still.
bool is_over(const Hired& hired, const std::vector<Status::Worker>& connected);

// Takes their key from the allow-list, and the directory away; what they wrote stays in pilots/NAME.log.
void clear_away(const ClusterPlace& place, const Hired& hired);

// The same for all that are over, but for those of the last minutes, which may only be about to begin.
void clear_up(const ClusterPlace& place, const std::vector<Status::Worker>& connected);

// The last line that a pilot wrote; empty: none.
std::string last_log_line(const Hired& hired, int task);

}  // namespace flamefield
