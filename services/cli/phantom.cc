#include "reconstruct/phantom/phantom.h"
#include "reconstruct/phantom/setup.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/config/suggestion.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

struct Options {
  std::string kind;
  DomainOptions domain;
  std::uint64_t seed = 1;
  double time_s = 0;
  int finer = 1;
  std::filesystem::path out;
};

// The grid asked for, or the article's; its voxels so many times smaller.
Grid grid_of(const Options& options, PhantomKind kind) {
  const PhantomSetup setup = paper_setup(kind);
  Grid grid = options.domain.size.empty() ? setup.grid() : options.domain.grid();
  if (options.finer == 1) return grid;
  const Eigen::Vector3d lower_mm = grid.lower_mm();
  grid.nx *= options.finer, grid.ny *= options.finer, grid.nz *= options.finer;
  grid.spacing_mm /= options.finer;
  grid.origin_mm = lower_mm + 0.5 * grid.spacing_mm;
  or_usage(validate(grid));
  return grid;
}

void run(const Options& options, const Session& session) {
  const auto kind = phantom_kind_from_name(options.kind);
  if (!kind) {
    throw CommandFailure{ExitCode::Usage,
                         concat("unknown phantom '", options.kind, "' (there is none of this name) ",
                                suggest(options.kind, {"torus", "hollow-sphere", "gaussian", "bunsen",
                                                       "swirl", "stratified"}))};
  }
  const Grid grid = grid_of(options, *kind);
  check_volume_output(options.out);
  const Volume volume = make_phantom({*kind, options.seed, options.time_s}, grid);
  session.check_stop();
  or_fail(write_volume(options.out, volume,
                       {{"program", concat("flamefield ", program_version())},
                        {"phantom", options.kind},
                        {"seed", std::to_string(options.seed)},
                        {"time_s", concat(options.time_s)}}));
  std::cout << options.out.string() << ": " << options.kind << ", " << grid.nx << " x " << grid.ny << " x "
            << grid.nz << " voxels\n";
}

}  // namespace

void add_phantom(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("phantom", "Make a known field: a body or a turbulent flame");
  command->add_option("KIND", options->kind, "torus, hollow-sphere, gaussian, bunsen, swirl or stratified")
      ->required();
  add_domain(*command, options->domain, false);
  command->add_option("--finer", options->finer, "Voxels so many times smaller on each axis, in the same box")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--seed", options->seed, "Of the turbulence")->capture_default_str();
  command->add_option("--time-s", options->time_s, "The flames evolve in time")->capture_default_str();
  command->add_option("--out", options->out, "Volume to write: .vtkhdf .vti .npy .tif")->required();
  command->footer(
      "Examples:\n  flamefield phantom bunsen --size 150,180,150 --spacing-mm 0.33 --seed 7 --out "
      "truth.vtkhdf\n"
      "  flamefield phantom swirl --finer 3 --time-s 0.2 --out truth.vtkhdf    (the article's box, without "
      "--size)");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
