#pragma once

#include <string>
#include <vector>

#include "proto/volume.h"
#include "services/plan/rates.h"

namespace flamefield {

// What is to be done.
struct Campaign {
  double sets = 1;
  int views = 15;
  int frame_width_px = 656, frame_height_px = 494;  // as the cameras send them
  int bytes_per_pixel = 2;
  int image_width_px = 0,
      image_height_px = 0;  // as reconstruction sees them; 0: as wide and high as the grid
  Grid grid;
  int iterations = 0;

  double frame_bytes() const;   // of one set
  double volume_bytes() const;  // of one set
  double voxels() const { return static_cast<double>(grid.voxels()); }
  double pixels() const;
};

// What there is to do it with.
struct Cluster {
  int nodes = 1, cores = 1;  // cores of a node
  double memory_mib = 0;     // of a node
  double network_bytes_per_s = 1.25e8;
  int threads = 1;          // of a worker, or of a rank
  double efficiency = 0.9;  // of threads and cores that share memory, against one alone
};

// A part of the campaign that goes on at the same time as the others; the longest one decides.
struct Stage {
  std::string name;
  double seconds = 0;
};

struct Estimate {
  double set_s = 0, set_mib = 0;  // of one reconstruction, on one worker or on all ranks
  int workers = 0, per_node = 0;  // or ranks
  std::vector<Stage> stages;
  double wall_s = 0;
  std::string bottleneck;
  double bytes_in = 0, bytes_out = 0;      // of all sets: frames to workers, volumes back
  double iteration_s = 0, exchange_s = 0;  // of ranks: an iteration, and what of it is spent on the network
  double exchange_bytes = 0;               // of a rank, in an iteration
  std::vector<std::string> problems;       // what does not fit, and what would
};

// Many sets, each on one worker. Frames and volumes go through the dispatcher's network card; it stores and
// leases `dispatch_s` a set.
Estimate plan_sets(const Campaign& campaign, const Cluster& cluster, const Rates& rates, double dispatch_s);

// Sets one after the other, each on all nodes (flamefield-mpi): slabs of planes, images on every rank.
Estimate plan_ranks(const Campaign& campaign, const Cluster& cluster, const Rates& rates);

}  // namespace flamefield
