#include "services/plan/plan.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/slabs.h"

namespace flamefield {

namespace {

constexpr double kMiB = 1048576;
constexpr double kFloat = sizeof(float);
// Planes that neighbours pass to each other in an iteration of the default solver: the field both ways, its
// second differences along z both ways, two mixed ones and the gradient.
constexpr double kHaloPlanes = 7;

// The longest stage: all go on at the same time.
void decide(Estimate& out) {
  const auto longest = std::ranges::max_element(out.stages, {}, &Stage::seconds);
  out.wall_s = longest->seconds;
  out.bottleneck = longest->name;
}

double solve_s(const Campaign& c, const Rates& r, double voxels) {
  return voxels * (r.voxel_set_up_s + c.iterations * r.voxel_iteration_s) +
         c.pixels() * c.iterations * r.pixel_iteration_s;
}

// Cores that share memory do not all run as fast as one alone.
double speed(const Cluster& c, int busy) {
  return busy > 1 ? c.efficiency * busy : 1;
}

}  // namespace

double Campaign::frame_bytes() const {
  return static_cast<double>(views) * frame_width_px * frame_height_px * bytes_per_pixel;
}
double Campaign::volume_bytes() const {
  return kFloat * voxels();
}
double Campaign::pixels() const {
  const double width = image_width_px > 0 ? image_width_px : std::max(grid.nx, grid.nz);
  return views * width * (image_height_px > 0 ? image_height_px : grid.ny);
}

Estimate plan_sets(const Campaign& c, const Cluster& cluster, const Rates& rates, double dispatch_s) {
  Estimate out;
  out.set_mib = (rates.base_bytes + rates.voxel_bytes * c.voxels() + rates.pixel_bytes * c.pixels() +
                 2 * c.frame_bytes()) /
                kMiB;
  const int by_cores = std::max(1, cluster.cores / cluster.threads);
  const int by_memory = static_cast<int>(cluster.memory_mib / out.set_mib);
  out.per_node = std::min(by_cores, by_memory);
  out.workers = out.per_node * cluster.nodes;
  out.bytes_in = c.sets * c.frame_bytes();
  out.bytes_out = c.sets * c.volume_bytes();
  if (out.per_node < 1) {
    out.problems.push_back(concat("one reconstruction needs ", std::ceil(out.set_mib), " MiB, a node has ",
                                  cluster.memory_mib,
                                  " MiB: nodes with more memory, larger voxels, or --mpi"));
    out.workers = cluster.nodes;  // to say at least what it would take
    out.per_node = 1;
  } else if (out.per_node < by_cores) {
    out.problems.push_back(concat("memory is enough for ", out.per_node, " workers a node, with cores for ",
                                  by_cores, ": more threads a worker (--threads) use them"));
  }
  if (cluster.threads > cluster.cores)
    out.problems.push_back(concat(cluster.threads, " threads a worker on ", cluster.cores, " cores a node"));
  const double alone_s = solve_s(c, rates, c.voxels());
  const double busy = static_cast<double>(out.per_node) * cluster.threads;
  const double slower = busy > 1 ? cluster.efficiency : 1;
  out.set_s = alone_s / (cluster.threads * slower);
  out.stages = {
      {"computing", std::ceil(c.sets / out.workers) * out.set_s},
      {"network of the dispatcher", (out.bytes_in + out.bytes_out) / cluster.network_bytes_per_s},
      {"network of a node", (out.bytes_in + out.bytes_out) / cluster.nodes / cluster.network_bytes_per_s},
      {"dispatcher", c.sets * dispatch_s}};
  if (c.sets < out.workers)
    out.problems.push_back(concat(out.workers, " workers, but only ", c.sets,
                                  " sets: ", out.workers - static_cast<int>(c.sets), " stay idle"));
  decide(out);
  return out;
}

Estimate plan_ranks(const Campaign& c, const Cluster& cluster, const Rates& rates) {
  Estimate out;
  out.per_node = std::max(1, cluster.cores / cluster.threads);
  out.workers = out.per_node * cluster.nodes;
  const int slabs = static_cast<int>(slabs_of(c.grid.nz).size());
  if (out.workers > slabs) {
    out.problems.push_back(concat(out.workers, " ranks, but ", c.grid.nz, " planes make ", slabs,
                                  " slabs: the others would be refused; more threads a rank (--threads)"));
    out.workers = slabs;
    out.per_node = std::min(out.per_node, (slabs + cluster.nodes - 1) / cluster.nodes);
  }
  const double share = std::ceil(static_cast<double>(slabs) / out.workers) / slabs;  // of the fullest rank
  const double rounds = std::ceil(std::log2(out.workers));
  const double image_bytes = kFloat * c.pixels();
  // Partial sums of images wait in pairs, pairs of pairs ...; the first rank puts the volume together.
  const double folds = std::floor(std::log2(std::max(1.0, share * slabs))) + 1;
  const double rank_bytes = rates.base_bytes + rates.voxel_bytes * c.voxels() * share +
                            rates.pixel_bytes * c.pixels() + folds * image_bytes;
  out.set_mib = rank_bytes / kMiB;
  const double node_mib = out.set_mib * out.per_node;
  if (node_mib > cluster.memory_mib)
    out.problems.push_back(concat("a node's ranks need ", std::ceil(node_mib), " MiB of ", cluster.memory_mib,
                                  ": more nodes, more threads a rank, or larger voxels"));
  const double whole_mib = 2 * c.volume_bytes() / kMiB + (out.per_node - 1) * out.set_mib;
  if (whole_mib > cluster.memory_mib)
    out.problems.push_back(concat("the first rank gathers the volume: ", std::ceil(whole_mib), " MiB of ",
                                  cluster.memory_mib, " on its node"));
  const double plane_bytes = kFloat * c.grid.nx * static_cast<double>(c.grid.ny);
  out.exchange_bytes = 2 * rounds * image_bytes + (out.workers > 1 ? kHaloPlanes * plane_bytes : 0);
  out.exchange_s = out.exchange_bytes / cluster.network_bytes_per_s * (cluster.nodes > 1 ? out.per_node : 0);
  const double rank_speed =
      speed(cluster, cluster.threads) * (out.per_node > 1 && cluster.threads == 1 ? cluster.efficiency : 1);
  const double field_s = rates.voxel_iteration_s * c.voxels() * share / rank_speed;
  const double image_s = rates.pixel_iteration_s * c.pixels() / rank_speed;
  out.iteration_s = field_s + image_s + out.exchange_s;
  out.set_s = rates.voxel_set_up_s * c.voxels() * share / rank_speed + c.iterations * out.iteration_s +
              c.volume_bytes() / cluster.network_bytes_per_s;
  out.bytes_in = c.sets * c.frame_bytes() * cluster.nodes;
  out.bytes_out = c.sets * c.volume_bytes();
  // One after the other, in every iteration.
  out.stages = {{"computing the field", c.sets * c.iterations * field_s},
                {"images, the same on every rank", c.sets * c.iterations * image_s},
                {"exchange over the network", c.sets * c.iterations * out.exchange_s},
                {"gathering the volume", c.sets * c.volume_bytes() / cluster.network_bytes_per_s}};
  decide(out);
  out.wall_s = c.sets * out.set_s;
  return out;
}

}  // namespace flamefield
