#include "services/worker/reconstruct_job.h"

#include <chrono>
#include <deque>
#include <memory>
#include <utility>

#include "proto/fingerprint.h"
#include "proto/utc.h"
#include "proto/version.h"
#include "reconstruct/parallel.h"
#include "reconstruct/prepare.h"
#include "reconstruct/solver.h"
#include "services/store/projection_file.h"
#include "services/store/sha256.h"
#include "services/store/volume_file.h"
#include "services/worker/best_so_far.h"
#include "services/worker/machine.h"

namespace flamefield {

namespace {

using Clock = std::chrono::steady_clock;

constexpr double kPreviewEvery_s = 2;

// Seconds since the last call.
class Lap {
 public:
  double operator()() {
    const auto now = Clock::now();
    return std::chrono::duration<double>(now - std::exchange(last_, now)).count();
  }

 private:
  Clock::time_point last_ = Clock::now();
};

// The few newest values by name.
template <class Value>
class Shelf {
 public:
  const Value* find(const std::string& key) const {
    for (const auto& [name, value] : entries_) {
      if (name == key) return &value;
    }
    return nullptr;
  }
  void replace(const std::string& key, Value value, std::size_t room) {
    std::erase_if(entries_, [&](const auto& entry) { return entry.first == key; });
    put(key, std::move(value), room);
  }
  const Value& put(std::string key, Value value, std::size_t room) {
    if (entries_.size() >= room) entries_.pop_front();
    entries_.emplace_back(std::move(key), std::move(value));
    return entries_.back().second;
  }

 private:
  std::deque<std::pair<std::string, Value>> entries_;
};

std::string projector_key(const Rig& rig, const Grid& grid, const ProjectorOptions& options) {
  Processing only_grid;
  only_grid.grid = grid;
  return concat(fingerprint(rig), ' ', recipe_fingerprint(only_grid), ' ', options.pixel_samples, ' ',
                options.step_voxels, ' ', options.memory_budget_mib);
}

Provenance provenance_of(const Run& run) {
  Provenance facts = {{"run", run.id},
                      {"solver", run.solver},
                      {"rig", run.processing.rig_id},
                      {"recipe", fingerprint(run.processing.recipe)},
                      {"program_version", run.program_version},
                      {"capture", run.inputs.at(0).capture},
                      {"sets", std::to_string(run.inputs.size())}};
  if (run.inputs.size() == 1) facts["set"] = std::to_string(run.inputs[0].index);
  return facts;
}

std::string fingerprint_of(const Volume& volume) {
  Fingerprint print;
  print.add(std::as_bytes(std::span(volume.values)));
  return print.text();
}

class ReconstructJob {
 public:
  explicit ReconstructJob(const ReconstructJobOptions& options) : options_(options), team_(options.threads) {}
  Result<Run> operator()(const JobContext& context);

 private:
  Result<MeanImages> reference(const JobContext& context, std::span<const SetId> sets);
  Result<std::shared_ptr<const Preparer>> preparer(const JobContext& context, const CameraImages& flame,
                                                   const PrepareOptions& options);
  Result<Prepared> prepare_inputs(const JobContext& context, Run& run, Lap& lap);
  Result<Reconstruction> solve(const JobContext& context, Run& run, const Prepared& prepared);
  Result<> write_files(const JobContext& context, Run& run, const Prepared& prepared,
                       const Reconstruction& solved);

  ReconstructJobOptions options_;
  Team team_;
  Shelf<MeanImages> references_;
  Shelf<std::shared_ptr<const Preparer>> preparers_;
  Shelf<std::shared_ptr<const Projector>> projectors_;
  // The newest volume of each capture and way of processing: where the next one of a live capture starts.
  struct LastVolume {
    std::string run_id;
    SetId set;
    Volume volume;
  };
  Shelf<LastVolume> last_volumes_;
};

// Live work only: what is done at leisure must not depend on what happened to be done before.
std::string warm_key(const Job& job) {
  if (job.priority != Priority::Live || job.inputs.size() != 1) return {};
  if (!takes_warm_start(job.processing.recipe.solver)) return {};
  return concat(job.inputs[0].capture, ' ', recipe_fingerprint(job.processing), ' ', job.processing.rig_id);
}

// Named by its sets: a capture that has grown is averaged anew.
std::string reference_key(std::span<const SetId> sets) {
  return sets.empty() ? "none" : concat(sets[0].capture, ' ', sets.size());
}

Result<MeanImages> ReconstructJob::reference(const JobContext& context, std::span<const SetId> sets) {
  if (sets.empty()) return MeanImages();
  const std::string key = reference_key(sets);
  if (const MeanImages* known = references_.find(key)) return *known;
  auto fetched = context.fetch(sets);
  if (!fetched) return tl::unexpected(fetched.error());
  auto images = mean_images(*fetched);
  if (!images) return tl::unexpected(images.error());
  return references_.put(key, std::move(*images), 6);
}

// The maps from sensors to level cameras, and what references say, hold for a whole burst.
Result<std::shared_ptr<const Preparer>> ReconstructJob::preparer(const JobContext& context,
                                                                 const CameraImages& flame,
                                                                 const PrepareOptions& options) {
  const Job& job = context.lease.job;
  const auto rig = rig_of_images(context.lease.rig, flame);
  if (!rig) return tl::unexpected(rig.error());
  const std::string key =
      concat(fingerprint(*rig), ' ', recipe_fingerprint(job.processing), ' ', reference_key(job.dark), ' ',
             reference_key(job.background), ' ', reference_key(job.flat));
  if (const auto* known = preparers_.find(key)) return *known;
  const auto dark = reference(context, job.dark);
  if (!dark) return tl::unexpected(dark.error());
  const auto background = reference(context, job.background);
  if (!background) return tl::unexpected(background.error());
  const auto flat = reference(context, job.flat);
  if (!flat) return tl::unexpected(flat.error());
  auto made = Preparer::make(*rig, {*dark, *background, *flat}, job.processing.grid, options, team_);
  if (!made) return tl::unexpected(made.error());
  return preparers_.put(key, std::make_shared<const Preparer>(std::move(*made)), 4);
}

Result<Prepared> ReconstructJob::prepare_inputs(const JobContext& context, Run& run, Lap& lap) {
  const Job& job = context.lease.job;
  const auto options = prepare_options(job.processing.recipe);
  if (!options) return tl::unexpected(options.error());
  auto sets = context.fetch(job.inputs);
  if (!sets) return tl::unexpected(sets.error());
  if (sets->size() > 1) sets = phase_locked(*sets, options->phase);
  if (!sets) return tl::unexpected(sets.error());
  run.timings.fetch_s = lap();
  context.progress({.token = 0, .run_id = {}, .stage = "prepare"});
  const auto flame = mean_images(*sets);
  if (!flame) return tl::unexpected(flame.error());
  const auto ready = preparer(context, flame->images, *options);
  if (!ready) return tl::unexpected(ready.error());
  auto prepared = (**ready)(*flame, team_);
  run.timings.prepare_s = lap();
  return prepared;
}

Result<Reconstruction> ReconstructJob::solve(const JobContext& context, Run& run, const Prepared& prepared) {
  const Job& job = context.lease.job;
  const Processing& processing = job.processing;
  const auto options = projector_options(processing.recipe);
  if (!options) return tl::unexpected(options.error());
  const std::string key = projector_key(prepared.rig, processing.grid, *options);
  const auto* known = projectors_.find(key);
  if (!known) {
    auto made = Projector::make(prepared.rig, processing.grid, *options, team_);
    if (!made) return tl::unexpected(made.error());
    known = &projectors_.put(key, std::make_shared<const Projector>(std::move(*made)), 2);
  }
  SolveControl control;
  control.threads = options_.threads;
  control.stop = context.stop;
  control.progress = [&](const SolverProgress& p) {
    context.progress({.token = 0,
                      .run_id = {},
                      .stage = "solve",
                      .iteration = p.iteration,
                      .max_iterations = p.max_iterations,
                      .residual = p.residual,
                      .elapsed_s = p.elapsed_s});
  };
  // A picture for the live page: when it cannot be written, the work goes on without.
  const auto best_path = best_so_far_path(options_.data_dir, context.lease.job.run_id, context.lease.token);
  std::error_code problem;
  control.preview = [&](const Volume& best) {
    std::filesystem::create_directories(best_path.parent_path(), problem);
    (void)write_volume(best_path, best, {});
  };
  control.preview_every_s = kPreviewEvery_s;
  const std::string key_of_last = warm_key(job);
  const LastVolume* last = key_of_last.empty() ? nullptr : last_volumes_.find(key_of_last);
  if (last) {
    control.start = &last->volume;
    run.warm_start = last->run_id;
  }
  auto solved = reconstruct(prepared.projections, **known, processing.recipe, control);
  std::filesystem::remove(best_path, problem);
  // Older sets are made up for when there is time: they must not take the place of a newer one.
  const bool newer = !last || last->set < job.inputs[0];
  if (solved && !key_of_last.empty() && newer)
    last_volumes_.replace(key_of_last, {job.run_id, job.inputs[0], solved->volume}, 2);
  return solved;
}

Result<> ReconstructJob::write_files(const JobContext& context, Run& run, const Prepared& prepared,
                                     const Reconstruction& solved) {
  const auto staged = [&](const std::string& path) {
    return options_.data_dir / staged_path(path, context.lease.token);
  };
  std::error_code problem;
  std::filesystem::create_directories(options_.data_dir / "volumes", problem);
  const Provenance facts = provenance_of(run);
  if (auto ok = write_projections(staged(run.projections_path), prepared.projections, facts); !ok) return ok;
  if (auto ok = write_volume(staged(run.volume_path), solved.volume, facts, solved.sigma); !ok) return ok;
  run.volume_bytes = static_cast<std::int64_t>(std::filesystem::file_size(staged(run.volume_path), problem));
  run.projections_bytes =
      static_cast<std::int64_t>(std::filesystem::file_size(staged(run.projections_path), problem));
  for (auto [path, sum] : {std::pair(&run.volume_path, &run.volume_sha256),
                           std::pair(&run.projections_path, &run.projections_sha256)}) {
    auto hash = sha256_of_file(staged(*path));
    if (!hash) return tl::unexpected(hash.error());
    *sum = std::move(*hash);
  }
  run.volume_fingerprint = fingerprint_of(solved.volume);
  return {};
}

Result<Run> ReconstructJob::operator()(const JobContext& context) {
  const Job& job = context.lease.job;
  Run run;
  run.id = job.run_id;
  run.job_id = job.id;
  run.inputs = job.inputs;
  run.processing = job.processing;
  run.program_version = program_version();
  run.worker = context.worker;
  run.seed = static_cast<std::int64_t>(SolveControl{}.seed);
  run.volume_path = "volumes/" + job.run_id + ".vtkhdf";
  run.projections_path = "volumes/" + job.run_id + ".projections.nxs";
  run.host = host_name();
  run.threads = team_.threads();
  run.estimated_s = job.estimated_s;
  run.estimated_mib = job.estimated_mib;
  reset_peak_memory();
  run.started_time_ns = utc_now_ns();
  run.timings.queue_s = static_cast<double>(run.started_time_ns - job.created_time_ns) * 1e-9;

  Lap lap;
  const auto prepared = prepare_inputs(context, run, lap);
  if (!prepared) return tl::unexpected(prepared.error());
  run.provenance = prepared->provenance;
  const auto solved = solve(context, run, *prepared);
  if (!solved) return tl::unexpected(solved.error());
  run.timings.solve_s = lap();
  if (context.stop.stop_requested())
    return unavailable(concat("run ", run.id), "it was stopped before it was done", "it will be done again");
  run.solver = solved->solver;
  run.projector_engine = solved->projector_engine;
  run.stop_reason = name_of(solved->stop_reason);
  run.iterations = solved->iterations;
  run.residual = solved->residual;
  run.provenance.insert(run.provenance.end(), solved->notes.begin(), solved->notes.end());
  run.voxel_updates = solved->voxel_updates;
  run.history = thinned(solved->history, kRunHistory);
  for (std::size_t i = 0; i < solved->residual_per_view.size(); ++i)
    run.residual_per_view[prepared->projections.view_names.at(i)] = solved->residual_per_view[i];
  context.progress({.token = 0, .run_id = {}, .stage = "write"});
  if (auto ok = write_files(context, run, *prepared, *solved); !ok) return tl::unexpected(ok.error());
  run.timings.write_s = lap();
  run.peak_rss_mib = peak_memory_mib();
  run.finished_time_ns = utc_now_ns();
  return run;
}

}  // namespace

JobStep make_reconstruct_step(const ReconstructJobOptions& options) {
  return [job = std::make_shared<ReconstructJob>(options)](const JobContext& context) {
    return (*job)(context);
  };
}

}  // namespace flamefield
