#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/frame.h"
#include "proto/recipe.h"
#include "proto/rig.h"
#include "proto/solve_history.h"
#include "proto/volume.h"

namespace flamefield {

// Names one stored frame set.
struct SetId {
  std::string capture;
  std::int64_t index = 0;
  auto operator<=>(const SetId&) const = default;
};

// Everything but the frames that decides which volume comes out.
struct Processing {
  std::string rig_id;  // fingerprint of a stored rig
  Recipe recipe;
  Grid grid;
  std::string dark_capture;  // reference captures; empty: none
  std::string background_capture;
  std::string flat_capture;
};

enum class Combine { Each, Mean };                     // one volume per set, or one of the mean of all sets
enum class Priority { Scheduled, Interactive, Live };  // the last goes first
enum class JobState { Queued, Leased, Done, Failed };
// Pause: not given out (a running job runs on). Cancel: fails, also while it runs. Retry: a failed job waits
// again.
enum class JobAction { Pause, Resume, Cancel, Retry };
std::string_view name_of(Combine combine);
std::string_view name_of(Priority priority);
std::string_view name_of(JobState state);
std::string_view name_of(JobAction action);
std::optional<JobState> job_state_from_name(std::string_view name);
std::optional<Priority> priority_from_name(std::string_view name);

// One volume to be made. The identity of the work is (inputs, processing, program version).
struct Job {
  std::int64_t id = 0;
  std::string run_id;  // known before the work starts: also the name of the files
  std::vector<SetId> inputs;
  Processing processing;
  std::vector<SetId> dark, background, flat;  // the sets of the reference captures
  Priority priority = Priority::Interactive;
  int attempt = 0;  // 1 for the first try
  std::int64_t created_time_ns = 0;
  std::string program_version;
  std::string submitter;                      // shares the workers with others of equal priority
  std::int64_t submission = 0;                // jobs that were asked for together
  double estimated_s = 0, estimated_mib = 0;  // of the run, from runs before; 0: unknown
};

// The right to work on a job until the deadline. Tokens grow: an older one never commits (fencing).
struct Lease {
  std::int64_t token = 0;
  std::int64_t duration_ms = 0;  // from receipt, unless extended by a heartbeat
  Job job;
  Rig rig;
};

struct Progress {
  std::int64_t token = 0;
  std::string run_id;
  std::string stage;  // fetch, prepare, solve, write
  int iteration = 0;
  int max_iterations = 0;
  double residual = 0;
  double elapsed_s = 0;
};

struct RunTimings {
  double queue_s = 0;  // from creation of the job to the lease
  double fetch_s = 0;
  double prepare_s = 0;
  double solve_s = 0;
  double write_s = 0;
};

inline constexpr std::size_t kRunHistory = 60;

// The record of one finished volume.
struct Run {
  std::string id;
  std::int64_t job_id = 0;
  std::vector<SetId> inputs;
  Processing processing;
  std::string program_version;
  std::string worker;
  std::string volume_path;       // relative to the data directory
  std::string projections_path;  // the prepared images; empty: not kept
  std::int64_t volume_bytes = 0;
  std::string volume_fingerprint;
  std::string solver;
  std::string projector_engine;
  std::string stop_reason;
  int iterations = 0;
  double residual = 0;  // |Ax - b| / |b|
  double voxel_updates = 0;
  std::map<std::string, double> residual_per_view;  // by camera
  std::map<std::string, double> metrics;            // e.g. pearson_3d against a known truth
  std::vector<std::string> provenance;              // one line per preparation step
  std::vector<HistoryPoint> history;                // of the solve, at most kRunHistory points
  std::string volume_sha256, projections_sha256;    // of the files, hexadecimal
  std::int64_t projections_bytes = 0;
  std::int64_t seed = 0;  // of the stochastic solvers
  RunTimings timings;
  std::string host;  // where it was made
  int threads = 0;
  double peak_rss_mib = 0;                    // the most that the worker's process held meanwhile
  double estimated_s = 0, estimated_mib = 0;  // before the run; 0: unknown
  std::string warm_start;                     // run whose volume the solver started from; empty: none
  std::int64_t started_time_ns = 0, finished_time_ns = 0;  // UTC
};

// (sets and reference captures), and (recipe and grid): two parts of a run's identity.
std::string inputs_fingerprint(const Job& job);
std::string recipe_fingerprint(const Processing& processing);

// A file-safe, readable name: "<capture>-<index|mean>-<8 hex digits of the identity>".
std::string run_id_of(const Job& job);

// May this text become part of a file name? Letters, digits, '.', '_', '-', at most 200, not starting with
// '.'.
bool is_file_safe(std::string_view name);

// An attempt writes under a name of its own; the commit renames it, so a stale worker can never replace
// the result of a later one. "volumes/x.vtkhdf", 7 -> "volumes/x.part-7.vtkhdf"
std::string staged_path(std::string_view path, std::int64_t token);

}  // namespace flamefield
