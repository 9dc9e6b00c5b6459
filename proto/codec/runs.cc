// What was done: progress and runs.
#include "proto/codec/wire.h"

namespace flamefield {

namespace {

// A path below the data directory: names joined by '/'.
void check_path(const std::string& path, std::string_view field, Check& check) {
  check.require(path.size() <= 400, field, "is too long");
  std::size_t from = 0;
  while (from <= path.size() && check.problem().empty()) {
    const std::size_t to = std::min(path.find('/', from), path.size());
    check.require(is_file_safe(path.substr(from, to - from)), field,
                  "is not a path below the data directory");
    from = to + 1;
  }
}

}  // namespace

void write(const Progress& progress, v1::Progress* wire) {
  wire->set_token(progress.token);
  wire->set_run_id(progress.run_id);
  wire->set_stage(progress.stage);
  wire->set_iteration(progress.iteration);
  wire->set_max_iterations(progress.max_iterations);
  wire->set_residual(progress.residual);
  wire->set_elapsed_s(progress.elapsed_s);
}

void read(const v1::Progress& wire, Progress& progress, Check& check) {
  progress = {wire.token(),          wire.run_id(),   wire.stage(),    wire.iteration(),
              wire.max_iterations(), wire.residual(), wire.elapsed_s()};
  check.finite(progress.residual, "residual");
  check.finite(progress.elapsed_s, "elapsed_s");
}

void write(const HistoryPoint& point, v1::HistoryPoint* wire) {
  wire->set_iteration(point.iteration);
  wire->set_residual(point.residual);
  wire->set_elapsed_s(point.elapsed_s);
  if (point.fitness == 0) return;  // only evolution has one, and operators
  wire->set_fitness(point.fitness);
  for (const float share : point.operator_success) wire->add_operator_success(share);
}

void read(const v1::HistoryPoint& wire, HistoryPoint& point, Check& check) {
  point = {wire.iteration(), wire.residual(), wire.elapsed_s(), wire.fitness(), {}};
  for (const double v : {point.residual, point.elapsed_s, point.fitness}) check.finite(v, "history");
  const auto operators =
      std::min(point.operator_success.size(), static_cast<std::size_t>(wire.operator_success_size()));
  for (std::size_t i = 0; i < operators; ++i) {
    point.operator_success[i] = wire.operator_success(static_cast<int>(i));
    check.finite(static_cast<double>(point.operator_success[i]), "operator success");
  }
}

void write(const Run& run, v1::Run* wire) {
  wire->set_id(run.id);
  wire->set_job_id(run.job_id);
  write_all(run.inputs, wire->mutable_inputs());
  write(run.processing, wire->mutable_processing());
  wire->set_program_version(run.program_version);
  wire->set_worker(run.worker);
  wire->set_volume_path(run.volume_path);
  wire->set_projections_path(run.projections_path);
  wire->set_volume_bytes(run.volume_bytes);
  wire->set_volume_fingerprint(run.volume_fingerprint);
  wire->set_solver(run.solver);
  wire->set_projector_engine(run.projector_engine);
  wire->set_stop_reason(run.stop_reason);
  wire->set_iterations(run.iterations);
  wire->set_residual(run.residual);
  wire->set_voxel_updates(run.voxel_updates);
  for (const auto& [camera, value] : run.residual_per_view)
    (*wire->mutable_residual_per_view())[camera] = value;
  for (const auto& [key, value] : run.metrics) (*wire->mutable_metrics())[key] = value;
  write_all(run.provenance, wire->mutable_provenance());
  write_all(run.history, wire->mutable_history());
  wire->set_queue_s(run.timings.queue_s);
  wire->set_fetch_s(run.timings.fetch_s);
  wire->set_prepare_s(run.timings.prepare_s);
  wire->set_solve_s(run.timings.solve_s);
  wire->set_write_s(run.timings.write_s);
  wire->set_started_time_ns(run.started_time_ns);
  wire->set_finished_time_ns(run.finished_time_ns);
  wire->set_volume_sha256(run.volume_sha256);
  wire->set_projections_sha256(run.projections_sha256);
  wire->set_projections_bytes(run.projections_bytes);
  wire->set_seed(run.seed);
  wire->set_host(run.host);
  wire->set_threads(run.threads);
  wire->set_estimated_s(run.estimated_s);
  wire->set_estimated_mib(run.estimated_mib);
  wire->set_peak_rss_mib(run.peak_rss_mib);
  wire->set_warm_start(run.warm_start);
}

void read(const v1::Run& wire, Run& run, Check& check) {
  run.id = wire.id();
  run.job_id = wire.job_id();
  read_all(wire.inputs(), run.inputs, check);
  read(wire.processing(), run.processing, check);
  run.program_version = wire.program_version();
  run.worker = wire.worker();
  run.volume_path = wire.volume_path();
  run.projections_path = wire.projections_path();
  check_path(run.volume_path, "volume path", check);
  if (!run.projections_path.empty()) check_path(run.projections_path, "projections path", check);
  run.volume_bytes = wire.volume_bytes();
  run.volume_fingerprint = wire.volume_fingerprint();
  run.solver = wire.solver();
  run.projector_engine = wire.projector_engine();
  run.stop_reason = wire.stop_reason();
  run.iterations = wire.iterations();
  run.residual = wire.residual();
  run.voxel_updates = wire.voxel_updates();
  read_numbers(wire.residual_per_view(), run.residual_per_view, "residual per view", check);
  read_numbers(wire.metrics(), run.metrics, "metrics", check);
  run.provenance.assign(wire.provenance().begin(), wire.provenance().end());
  read_all(wire.history(), run.history, check);
  run.timings = {wire.queue_s(), wire.fetch_s(), wire.prepare_s(), wire.solve_s(), wire.write_s()};
  run.started_time_ns = wire.started_time_ns();
  run.finished_time_ns = wire.finished_time_ns();
  run.volume_sha256 = wire.volume_sha256();
  run.projections_sha256 = wire.projections_sha256();
  run.projections_bytes = wire.projections_bytes();
  run.seed = wire.seed();
  check.count(run.projections_bytes, "projections bytes");
  run.host = wire.host();
  run.threads = wire.threads();
  run.estimated_s = wire.estimated_s();
  run.estimated_mib = wire.estimated_mib();
  run.peak_rss_mib = wire.peak_rss_mib();
  run.warm_start = wire.warm_start();
  if (!run.warm_start.empty()) check.require(is_file_safe(run.warm_start), "warm start", "is not a run");
  check.count(run.volume_bytes, "volume bytes");
  for (double v :
       {run.residual, run.voxel_updates, run.timings.queue_s, run.timings.fetch_s, run.timings.prepare_s,
        run.timings.solve_s, run.timings.write_s, run.estimated_s, run.estimated_mib, run.peak_rss_mib})
    check.finite(v, "run");
}

}  // namespace flamefield
