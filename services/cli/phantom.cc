#include "reconstruct/phantom/phantom.h"

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
  std::filesystem::path out;
};

void run(const Options& options, const Session& session) {
  const auto kind = phantom_kind_from_name(options.kind);
  if (!kind) {
    throw CommandFailure{ExitCode::Usage,
                         concat("unknown phantom '", options.kind, "' (there is none of this name) ",
                                suggest(options.kind, {"torus", "hollow-sphere", "gaussian", "bunsen",
                                                       "swirl", "stratified"}))};
  }
  const Grid grid = options.domain.grid();
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
  add_domain(*command, options->domain, true);
  command->add_option("--seed", options->seed, "Of the turbulence")->capture_default_str();
  command->add_option("--time-s", options->time_s, "The flames evolve in time")->capture_default_str();
  command->add_option("--out", options->out, "Volume to write: .vtkhdf .vti .npy .tif")->required();
  command->footer(
      "Example:\n  flamefield phantom bunsen --size 150,180,150 --spacing-mm 0.33 --seed 7 --out "
      "truth.vtkhdf");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
