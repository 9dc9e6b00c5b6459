// bench projector: the cost of forward and adjoint against what the machine can do at most.
#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "services/bench/projector_bench.h"
#include "services/cli/bench_commands.h"
#include "services/cli/bench_output.h"

namespace flamefield {

namespace {

struct Options {
  std::string name = "A";
  std::vector<int> size, image;
  int views = 0;
  std::vector<int> threads;
  std::vector<std::string> models = {"ray", "area"};
  double seconds = 1;
  bool json = false;
};

std::vector<int> one_and_all() {
  const std::set<int> counts = {1, std::max(1, static_cast<int>(std::thread::hardware_concurrency()))};
  return {counts.begin(), counts.end()};
}

ProjectorCase case_of(const Options& options) {
  ProjectorCase what = or_usage(projector_case(options.name));
  if (!options.size.empty()) {
    what.nx = options.size[0], what.ny = options.size[1], what.nz = options.size[2];
    what.cols = what.nx, what.rows = what.ny;
  }
  if (!options.image.empty()) what.cols = options.image[0], what.rows = options.image[1];
  if (options.views > 0) what.views = options.views;
  return what;
}

// One model of a pixel with what was measured of it.
struct Measured {
  ProjectorModel model;
  ProjectorMeasurement figures;

  // On the fewest threads.
  double forward_cpu_s() const { return figures.timings.front().forward_cpu_s; }
  double adjoint_cpu_s() const { return figures.timings.front().adjoint_cpu_s; }
};

nlohmann::json json_of(const Measured& m) {
  nlohmann::json timings = nlohmann::json::array();
  for (const ProjectorTiming& t : m.figures.timings) {
    timings.push_back({{"threads", t.threads},
                       {"repetitions", t.repetitions},
                       {"forward_cpu_s", t.forward_cpu_s},
                       {"forward_wall_s", t.forward_wall_s},
                       {"adjoint_cpu_s", t.adjoint_cpu_s},
                       {"adjoint_wall_s", t.adjoint_wall_s}});
  }
  return {{"model", name_of(m.model)},
          {"engine", m.figures.engine},
          {"set_up_wall_s", m.figures.set_up_wall_s},
          {"adjoint_mismatch", m.figures.adjoint_mismatch},
          {"by_threads", timings}};
}

// The figures that stand alone are those of the first model.
nlohmann::json json_of(const ProjectorCase& what, const std::vector<Measured>& all,
                       const MachineLimit& machine, const SampleLimit& limit, double peak_mib) {
  const Measured& first = all.front();
  nlohmann::json models = nlohmann::json::array();
  for (const Measured& m : all) models.push_back(json_of(m));
  const double rate = what.samples() / first.forward_cpu_s();
  return {{"case", what.name},
          {"views", what.views},
          {"image", {what.cols, what.rows}},
          {"volume", {what.nx, what.ny, what.nz}},
          {"engine", first.figures.engine},
          {"samples", what.samples()},
          {"forward_cpu_s", first.forward_cpu_s()},
          {"adjoint_cpu_s", first.adjoint_cpu_s()},
          {"adjoint_mismatch", first.figures.adjoint_mismatch},
          {"samples_per_cpu_s", rate},
          {"adjoint_samples_per_cpu_s", what.samples() / first.adjoint_cpu_s()},
          {"limit_samples_per_cpu_s", limit.samples_per_cpu_s},
          {"limit_bound_by", limit.bound_by},
          {"share_of_limit", rate / limit.samples_per_cpu_s},
          {"vectors", machine.vectors},
          {"peak_rss_mib", peak_mib},
          {"by_model", models}};
}

void print(const ProjectorCase& what, const std::vector<Measured>& all, const MachineLimit& machine,
           const SampleLimit& limit, double peak_mib) {
  std::printf("case %s: %d views of %d x %d px, %d x %d x %d voxels, %.3g samples\n\n", what.name.c_str(),
              what.views, what.cols, what.rows, what.nx, what.ny, what.nz, what.samples());
  TextTable table({"pixel", "threads", "forward (CPU-s)", "(wall s)", "adjoint (CPU-s)", "(wall s)",
                   "forward (samples/CPU-s)", "of the limit (%)", "adjoint mismatch (1)", "set-up (s)"});
  for (const Measured& m : all)
    for (const ProjectorTiming& t : m.figures.timings) {
      const double rate = what.samples() / t.forward_cpu_s;
      table.add({name_of(m.model), concat(t.threads), short_number(t.forward_cpu_s),
                 short_number(t.forward_wall_s), short_number(t.adjoint_cpu_s),
                 short_number(t.adjoint_wall_s), short_number(rate),
                 short_number(100 * rate / limit.samples_per_cpu_s), short_number(m.figures.adjoint_mismatch),
                 short_number(m.figures.set_up_wall_s)});
    }
  std::cout << table.text();
  std::printf(
      "\nlimit        %.3g samples/CPU-s, set by %s (%s: %.3g multiply-adds/s; loads of %.3g floats/s from "
      "cache, %.3g from memory)\npeak memory  %.0f MiB\n"
      "pixel ray: its central ray; area: averaged over the pixel, the default of reconstruct\n",
      limit.samples_per_cpu_s, limit.bound_by.c_str(), machine.vectors.c_str(), machine.fma_per_s,
      machine.cached_floats_per_s, machine.memory_floats_per_s, peak_mib);
}

void run_projector(const Options& options, const Session& session) {
  const ProjectorCase what = case_of(options);
  std::vector<ProjectorModel> models;
  for (const std::string& name : options.models) models.push_back(or_usage(projector_model(name)));
  BenchProgress progress("bench projector", session);
  std::vector<Measured> all;
  for (ProjectorModel model : models) {
    all.push_back(
        {model, or_fail(measure_projector(
                    what, model, options.threads.empty() ? one_and_all() : options.threads, options.seconds,
                    [&](const std::string& step) { progress(concat(name_of(model), ", ", step)); }))});
  }
  const double peak_mib = peak_rss_mib();  // the limit needs memory of its own
  progress("the machine's limit");
  const MachineLimit machine = measure_machine();
  const double floats = double(what.nx) * what.ny * what.nz + double(what.views) * what.rows * what.cols;
  const SampleLimit limit = sample_limit(machine, what.samples(), floats);
  if (options.json) {
    std::cout << json_of(what, all, machine, limit, peak_mib).dump(2) << '\n';
  } else {
    print(what, all, machine, limit, peak_mib);
  }
}

}  // namespace

void add_bench_projector(CLI::App& group, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = group.add_subcommand("projector", "Forward and adjoint: CPU-seconds, samples, the limit");
  command
      ->add_option("--case", options->name,
                   "A: 15 views of 52x55, 52x55x52 voxels; B: 24 of 256x256, 256^3; C: 24 of 512x512, 512^3")
      ->capture_default_str();
  command->add_option("--size", options->size, "Other voxels: NX,NY,NZ; images of NX x NY")
      ->delimiter(',')
      ->expected(3);
  command->add_option("--image", options->image, "Other images: W,H")->delimiter(',')->expected(2);
  command->add_option("--views", options->views, "Other number of views")->check(CLI::Range(1, 1000));
  command->add_option("--model", options->models, "What a pixel sees: ray, area, trilinear")
      ->delimiter(',')
      ->capture_default_str();
  command->add_option("--threads", options->threads, "Numbers to measure with; default 1 and all")
      ->delimiter(',')
      ->check(CLI::Range(1, 1024));
  command->add_option("--seconds", options->seconds, "Least time spent on each figure")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer("Example:\n  flamefield bench projector --case B --json");
  command->callback(
      [options, &session] { session.choose([=, &session] { run_projector(*options, session); }); });
}

}  // namespace flamefield
