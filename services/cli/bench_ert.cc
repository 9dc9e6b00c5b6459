// bench ert: offspring a second of the evolutionary solver.
#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/bench/ert_bench.h"
#include "services/cli/bench_commands.h"
#include "services/cli/bench_output.h"
#include "services/cli/options.h"

namespace flamefield {

namespace {

struct Options {
  ErtBenchOptions bench;
  std::vector<int> size = {52, 55, 52};
  bool json = false;
};

void run(Options options, const Session& session) {
  options.bench.nx = options.size[0];
  options.bench.ny = options.size[1];
  options.bench.nz = options.size[2];
  BenchProgress progress("bench ert", session);
  const auto rates =
      or_fail(measure_ert(options.bench, session.stop(), [&](const std::string& step) { progress(step); }));
  session.check_stop();
  if (options.json) {
    nlohmann::json list = nlohmann::json::array();
    for (const ErtRate& r : rates) {
      list.push_back({{"scheme", r.scheme},
                      {"views", r.views},
                      {"offspring", r.offspring},
                      {"wall_s", r.seconds},
                      {"cpu_s", r.cpu_s},
                      {"offspring_per_s", r.per_s()}});
    }
    std::cout << nlohmann::json{{"volume", options.size},
                                {"threads", options.bench.threads},
                                {"peak_rss_mib", peak_rss_mib()},
                                {"rates", list}}
                     .dump(2)
              << '\n';
    return;
  }
  std::printf("stratified flame, %d x %d x %d voxels, %d threads\n\n", options.size[0], options.size[1],
              options.size[2], options.bench.threads);
  TextTable table({"scheme", "views", "offspring", "wall (s)", "offspring/s", "us each per view"});
  for (const ErtRate& r : rates) {
    table.add({r.scheme, concat(r.views), short_number(r.offspring), short_number(r.seconds),
               short_number(r.per_s()), short_number(1e6 / r.per_s() / r.views)});
  }
  std::cout << table.text();
}

}  // namespace

void add_bench_ert(CLI::App& group, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = group.add_subcommand(
      "ert", "Offspring a second of the evolutionary solver, beside rendering each by ray tracing");
  command->add_option("--size", options->size, "Voxels: NX,NY,NZ")
      ->delimiter(',')
      ->expected(3)
      ->capture_default_str();
  command->add_option("--views", options->bench.views, "Cameras")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  command->add_option("--seconds", options->bench.seconds, "Of each measurement")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_option("--threads", options->bench.threads, "0: all")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
  command->add_flag("--json", options->json, "Print the figures as JSON");
  command->footer("Example:\n  flamefield bench ert --seconds 4");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
