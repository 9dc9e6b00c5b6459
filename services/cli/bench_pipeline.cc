// bench pipeline: from frame sets to committed volumes, through spool, dispatcher and workers.
#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/bench/pipeline_bench.h"
#include "services/cli/bench_commands.h"
#include "services/cli/bench_output.h"
#include "services/cli/recipe_options.h"
#include "services/log/log.h"

namespace flamefield {

namespace {

struct Options {
  PipelineOptions pipeline;
  RecipeOptions recipe;
  std::filesystem::path folder;
  std::vector<int> size = {52, 55, 52}, image = {659, 494};
  bool json = false;
};

nlohmann::json json_of(const PipelineOptions& o, const PipelineMeasurement& m) {
  return {{"cameras", o.cameras},
          {"sets", o.sets},
          {"workers", o.workers},
          {"solver", o.recipe.solver},
          {"set_mib", m.set_mib},
          {"sets_per_s", m.sets_per_s},
          {"put_p99_ms", m.put_p99_ms},
          {"durable_sets_per_s", m.durable_sets_per_s},
          {"disk_sets_per_s", m.disk_sets_per_s},
          {"durable_over_disk", m.durable_sets_per_s / m.disk_sets_per_s},
          {"volumes_per_s", m.volumes_per_s},
          {"cpu_s_per_volume", m.cpu_s_per_volume},
          {"fetch_ms", m.fetch_ms},
          {"prepare_ms", m.prepare_ms},
          {"solve_ms", m.solve_ms},
          {"write_ms", m.write_ms},
          {"first_prepare_ms", m.first_prepare_ms},
          {"first_solve_ms", m.first_solve_ms},
          {"failed", m.failed},
          {"peak_rss_mib", peak_rss_mib()}};
}

void print(const PipelineOptions& o, const PipelineMeasurement& m) {
  std::printf("%d cameras of %d x %d px, %.3g MiB a set; %s, %d x %d x %d voxels, %d worker%s\n\n", o.cameras,
              o.image_width_px, o.image_height_px, m.set_mib, o.recipe.solver.c_str(), o.nx, o.ny, o.nz,
              o.workers, o.workers == 1 ? "" : "s");
  TextTable table({"stage", "mean (ms)", "longest (ms)"});
  table.add({"fetch frames", short_number(m.fetch_ms), ""});
  table.add({"prepare", short_number(m.prepare_ms), short_number(m.first_prepare_ms)});
  table.add({"solve", short_number(m.solve_ms), short_number(m.first_solve_ms)});
  table.add({"write", short_number(m.write_ms), ""});
  std::cout << table.text();
  std::printf(
      "\nstored         %.3g sets/s, one at a time; 99th percentile %.3g ms to the disk and back\n"
      "               %.3g sets/s, many at a time; the disk alone, one fdatasync a set: %.3g: %.2f of it\n"
      "reconstructed  %.3g volumes/s, %.3g CPU-s each; %d failed\n"
      "peak memory    %.0f MiB\n",
      m.sets_per_s, m.put_p99_ms, m.durable_sets_per_s, m.disk_sets_per_s,
      m.durable_sets_per_s / m.disk_sets_per_s, m.volumes_per_s, m.cpu_s_per_volume, m.failed,
      peak_rss_mib());
}

void run(Options options, const Session& session) {
  PipelineOptions& o = options.pipeline;
  o.recipe = options.recipe.recipe();
  o.nx = options.size[0], o.ny = options.size[1], o.nz = options.size[2];
  o.image_width_px = options.image[0], o.image_height_px = options.image[1];
  const BenchFolder folder(options.folder);
  o.data_dir = folder.path();
  set_log_level(LogLevel::Error);
  BenchProgress progress("bench pipeline", session);
  const PipelineMeasurement m =
      or_fail(measure_pipeline(o, session.stop(), [&](const std::string& stage) { progress(stage); }));
  if (options.json) {
    std::cout << json_of(o, m).dump(2) << '\n';
  } else {
    print(o, m);
  }
}

}  // namespace

void add_bench_pipeline(CLI::App& group, Session& session) {
  auto options = std::make_shared<Options>();
  options->folder = std::filesystem::temp_directory_path();
  PipelineOptions& o = options->pipeline;
  auto* command = group.add_subcommand("pipeline", "Frame sets to committed volumes, per second");
  command->add_option("--cameras", o.cameras, "Views")->check(CLI::Range(1, 200))->capture_default_str();
  command->add_option("--image", options->image, "Pixels of a sensor: W,H")
      ->delimiter(',')
      ->expected(2)
      ->check(CLI::Range(8, 10000));
  command->add_option("--size", options->size, "Voxels: NX,NY,NZ")
      ->delimiter(',')
      ->expected(3)
      ->check(CLI::Range(1, 2048));
  command->add_option("--sets", o.sets, "Pulses")->check(CLI::Range(1, 100000))->capture_default_str();
  command->add_option("--durable-sets", o.durable_sets, "Of the measurement against the disk")
      ->check(CLI::Range(1, 100000))
      ->capture_default_str();
  command->add_option("--workers", o.workers, "In this process")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--threads", o.threads, "Of each worker; 0: all")->check(CLI::Range(0, 1024));
  command->add_option("--folder", options->folder, "On the disk to measure")->capture_default_str();
  add_recipe(*command, options->recipe);
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer(
      "Example:\n  flamefield bench pipeline --sets 50 --solver mlem --set mlem.max_iterations=50");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
