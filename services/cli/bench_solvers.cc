// bench solvers: what a solver reaches, and in which time.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "reconstruct/solver.h"
#include "services/bench/solver_bench.h"
#include "services/cli/bench_commands.h"
#include "services/cli/bench_output.h"
#include "services/cli/options.h"

namespace flamefield {

namespace {

struct Options {
  std::vector<std::string> solvers;
  std::string phantom = "stratified";
  std::vector<int> size = {52, 55, 52};
  int views = 15;
  double spacing_deg = 12;
  std::vector<double> noise = {0, 0.02};
  double target = 0.98;
  double most_s = 30;
  int threads = 0;
  std::uint64_t seed = 1;
  bool json = false;
};

struct Row {
  double noise;
  SolverTiming timing;
};

SolverProblem problem_of(const Options& options, double noise) {
  const auto kind = phantom_kind_from_name(options.phantom);
  if (!kind) {
    throw CommandFailure{ExitCode::Usage, concat("phantom '", options.phantom,
                                                 "' (there is none of this name) see 'flamefield phantom "
                                                 "--help'")};
  }
  return or_usage(
      make_solver_problem({*kind, options.size[0], options.size[1], options.size[2], options.views,
                           rad_of_deg(options.spacing_deg), noise, options.seed, options.threads}));
}

nlohmann::json json_of(const Options& options, const std::vector<Row>& rows) {
  nlohmann::json list = nlohmann::json::array();
  for (const auto& [noise, t] : rows) {
    list.push_back({{"solver", t.solver},
                    {"noise", noise},
                    {"reached", t.reached},
                    {"iterations", t.iterations},
                    {"wall_s", t.wall_s},
                    {"cpu_s", t.cpu_s},
                    {"voxel_updates", t.voxel_updates},
                    {"pearson", t.pearson},
                    {"sqmd", t.sqmd}});
  }
  return {{"phantom", options.phantom},       {"volume", options.size},         {"views", options.views},
          {"target_pearson", options.target}, {"peak_rss_mib", peak_rss_mib()}, {"solvers", list}};
}

void run(const Options& options, const Session& session) {
  std::vector<std::string> names = options.solvers;
  if (names.empty())
    for (std::string_view name : solver_names()) names.emplace_back(name);
  const auto known = solver_names();
  for (const std::string& name : names) {
    if (std::ranges::find(known, name) == known.end())
      throw CommandFailure{ExitCode::Usage, concat("solver '", name,
                                                   "' (there is none of this name) see "
                                                   "'flamefield reconstruct --help'")};
  }
  BenchProgress progress("bench solvers", session);
  std::vector<Row> rows;
  for (double noise : options.noise) {
    progress(concat("render, noise ", 100 * noise, " %"));
    const SolverProblem problem = problem_of(options, noise);
    for (const std::string& name : names) {
      rows.push_back(
          {noise, or_fail(time_to_target(problem, name, options.target, options.most_s, options.threads,
                                         session.stop(), [&](const std::string& step) { progress(step); }))});
      session.check_stop();
    }
  }
  if (options.json) {
    std::cout << json_of(options, rows).dump(2) << '\n';
    return;
  }
  std::printf("%s, %d views, %d x %d x %d voxels; until Pearson %g, else the best within %g s\n\n",
              options.phantom.c_str(), options.views, options.size[0], options.size[1], options.size[2],
              options.target, options.most_s);
  TextTable table({"solver", "noise (%)", "reached", "iterations", "wall (s)", "CPU (s)", "Pearson", "SqMD"});
  for (const auto& [noise, t] : rows) {
    table.add({t.solver, short_number(100 * noise), t.reached ? "yes" : "no", concat(t.iterations),
               short_number(t.wall_s), short_number(t.cpu_s), fixed_number(t.pearson, 4),
               fixed_number(t.sqmd, 4)});
  }
  std::cout << table.text();
}

void add_options(CLI::App& command, Options& options) {
  command.add_option("--phantom", options.phantom, "The known field")->capture_default_str();
  command.add_option("--size", options.size, "Voxels: NX,NY,NZ")
      ->delimiter(',')
      ->expected(3)
      ->capture_default_str();
  command.add_option("--views", options.views, "Cameras")->check(CLI::Range(1, 1000))->capture_default_str();
  command.add_option("--spacing-deg", options.spacing_deg, "Between cameras")->capture_default_str();
  command.add_option("--noise", options.noise, "Gaussian, share of the brightest pixel")
      ->delimiter(',')
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  command.add_option("--target", options.target, "Pearson correlation to reach")->capture_default_str();
  command.add_option("--seconds", options.most_s, "Longest solve")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command.add_option("--threads", options.threads, "0: all")->check(CLI::Range(0, 1024));
  command.add_option("--seed", options.seed, "Of flame and noise")->capture_default_str();
  command.add_flag("--json", options.json, "Print the figures as JSON");
}

}  // namespace

void add_bench_solvers(CLI::App& group, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command =
      group.add_subcommand("solvers", "Time and iterations of each solver to a given correlation");
  command->add_option("--solver", options->solvers, "These only")->delimiter(',');
  add_options(*command, *options);
  command->footer("Example:\n  flamefield bench solvers --solver mlem,sirt --target 0.98");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
