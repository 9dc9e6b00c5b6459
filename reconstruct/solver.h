#pragma once

#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

#include "proto/image.h"
#include "proto/recipe.h"
#include "proto/rig.h"
#include "proto/solve_history.h"
#include "proto/volume.h"
#include "reconstruct/projector.h"
#include "reconstruct/settings.h"

namespace flamefield {

struct SolverProgress {
  int iteration = 0;
  int max_iterations = 0;
  double residual = 0;  // |Ax - b| / |b|
  double elapsed_s = 0;
};

// Outside control of a solve, no part of the recipe. A time limit or a stop ends it early with the best so
// far.
struct SolveControl {
  int threads = 0;          // 0: all
  double time_limit_s = 0;  // 0: none
  std::uint64_t seed = 1;   // of the stochastic solvers
  std::stop_token stop = {};
  std::function<void(const SolverProgress&)> progress = {};
  // A warm start, e.g. the field of the pulse before, on the same grid; must outlive the solve. Null: none.
  const Volume* start = nullptr;
  // Evolutionary solvers only: the best field so far now and then, for a live page; and, at the end too, all
  // that is needed to go on later, bit by bit as if it had never been interrupted (resume takes such bytes).
  std::function<void(const Volume&)> preview = {};
  double preview_every_s = 1;
  std::function<void(std::string_view)> checkpoint = {};
  double checkpoint_every_s = 30;
  std::string_view resume = {};
  // Other processes that work on the same solve, each with the same images, rig, grid and recipe; null: none.
  // The first one gets the volume, others an empty one. Must outlive the solve.
  Ranks* ranks = nullptr;
};

enum class StopReason {
  Iterations,
  Residual,
  Fitness,
  TimeLimit,
  Cancelled,
  Discrepancy,
  Stagnation,
  Converged
};
std::string_view name_of(StopReason reason);

struct Reconstruction {
  Volume volume;             // physical units: field unit as in the projections
  std::vector<float> sigma;  // likewise (nz, ny, nx): the noise's standard deviation of each voxel; or empty
  std::string solver;
  int iterations = 0;
  double residual = 0;                    // |Ax - b| / |b| at the end
  std::vector<double> residual_per_view;  // likewise, each view
  double wall_s = 0;
  double voxel_updates = 0;
  double offspring = 0;          // evolutionary solvers only
  std::string projector_engine;  // how A was applied, e.g. "stored 312 MiB"
  StopReason stop_reason = StopReason::Iterations;
  std::vector<HistoryPoint> history;
  std::vector<Camera>
      cameras;  // as corrected by a calibration-free solve, which `volume` goes with; or empty
  std::vector<std::string> notes;  // what the user should know: saturated images, a chosen weight
};

// Names for --solver, default first.
std::vector<std::string_view> solver_names();

// Runs the recipe's solver. InvalidInput: views that do not match the rig, NaN or infinity among the
// projections (named by view, row and column), unknown solver or setting (with the nearest known name), an
// empty or oversized grid, a rig that does not see it, a warm start of another grid or for a solver that has
// no use for one, several ranks for a solver that cannot be spread over them.
Result<Reconstruction> reconstruct(const Projections& projections, const Rig& rig, const Grid& grid,
                                   const Recipe& recipe, const SolveControl& control);

// The same with a projector made before, e.g. one for all pulses of a burst; views are matched by name.
Result<Reconstruction> reconstruct(const Projections& projections, const Projector& projector,
                                   const Recipe& recipe, const SolveControl& control);

// How a recipe wants its projector (table [projector]).
Result<ProjectorOptions> projector_options(const Recipe& recipe);

// The settings of a table: a solver's name, "projector", "prepare", or one of those that all solvers
// share: "constraints", "stop", "noise". Empty for others.
std::vector<SettingDoc> settings_of(std::string_view table);
std::vector<std::string_view> shared_tables();         // tables that are no solver's
std::string_view summary_of(std::string_view solver);  // one line with its source
bool takes_warm_start(std::string_view solver);        // false also for unknown ones

// What several ranks do with a solver: share the volume in slabs, or evolve islands.
enum class Division { None, Slabs, Islands };
Division division_of(std::string_view solver);  // None also for unknown ones

// Checks solver name and all tables of a recipe without running it.
Result<> validate_recipe(const Recipe& recipe);

}  // namespace flamefield
