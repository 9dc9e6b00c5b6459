#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <stop_token>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"
#include "proto/volume.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/projector.h"

namespace flamefield {

// A known field, rendered from voxels three times finer than it is reconstructed on, with or without noise.
struct SolverProblem {
  Volume truth;
  Projections projections;
  Projector projector;
};
struct SolverProblemOptions {
  PhantomKind kind = PhantomKind::Stratified;
  int nx = 52, ny = 55, nz = 52;  // voxels of 1 mm
  int views = 15;
  double spacing_rad = 0.20943951023931953;
  double noise = 0;  // Gaussian, share of the brightest pixel
  std::uint64_t seed = 1;
  int threads = 0;
};
Result<SolverProblem> make_solver_problem(const SolverProblemOptions& options);

struct SolverTiming {
  std::string solver;
  bool reached = false;  // the target; else these are the figures of the best that was seen
  int iterations = 0;
  double wall_s = 0;  // of a solve that stops at so many iterations
  double cpu_s = 0;
  double voxel_updates = 0;
  double pearson = std::numeric_limits<double>::quiet_NaN();
  double sqmd = std::numeric_limits<double>::quiet_NaN();
};

// Solves with 2, 4, 8 ... iterations (or seconds, where a solver counts none) until the correlation with the
// truth is at the target, falls, or a solve would take longer than `most_s`. Everything else is left at its
// default. `progress` hears each solve.
Result<SolverTiming> time_to_target(const SolverProblem& problem, const std::string& solver, double target,
                                    double most_s, int threads, std::stop_token stop,
                                    const std::function<void(const std::string&)>& progress);

}  // namespace flamefield
