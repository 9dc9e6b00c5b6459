// selftest: does this installation keep its promise when everything dies?
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdlib>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/cli/commands.h"
#include "services/cli/progress.h"
#include "services/log/log.h"
#include "services/selftest/chaos.h"

namespace flamefield {

namespace {

struct Options {
  ChaosOptions chaos;
  std::filesystem::path below;
  int repeat = 1;
  bool is_chaos = false, json = false;
};

// A folder of its own; kept when the test failed.
std::filesystem::path folder_below(const std::filesystem::path& below) {
  std::string name = (below / "flamefield-selftest-XXXXXX").string();
  if (!::mkdtemp(name.data()))
    throw CommandFailure{ExitCode::Usage,
                         concat("'", below.string(), "' (no folder can be made in it) name another one")};
  return name;
}

nlohmann::ordered_json json_of(const ChaosOptions& o, const ChaosResult& r) {
  return {{"seed", o.seed},
          {"sets", r.sets},
          {"lost", r.lost},
          {"committed_twice", r.committed_twice},
          {"kills", r.dispatcher_kills + r.worker_kills},
          {"dispatcher_kills", r.dispatcher_kills},
          {"worker_kills", r.worker_kills},
          {"cuts", r.cuts},
          {"freezes", r.freezes},
          {"sent_again", r.sent_again},
          {"receipts_balance", r.balances},
          {"problems", r.problems},
          {"wall_s", r.wall_s}};
}

void print(const ChaosOptions& o, const ChaosResult& r) {
  std::cout << concat("seed ", o.seed, ": ", r.sets, " sets, ", r.dispatcher_kills, " dispatchers and ",
                      r.worker_kills, " workers killed, ", r.cuts, " cuts, ", r.freezes, " frozen: lost ",
                      r.lost, ", committed twice ", r.committed_twice, ", receipts ",
                      r.balances ? "balance" : "DO NOT BALANCE", ", ", std::lround(r.wall_s), " s\n");
  for (const std::string& problem : r.problems) std::cout << "  " << problem << '\n';
}

void run(Options options, const Session& session) {
  if (!options.is_chaos)
    throw CommandFailure{ExitCode::Usage, "no test was chosen (there is one so far) add --chaos"};
  options.chaos.programs = std::filesystem::read_symlink("/proc/self/exe").parent_path();
  auto all = nlohmann::ordered_json::array();
  bool survived = true;
  for (int i = 0; i < options.repeat; ++i, ++options.chaos.seed) {
    options.chaos.directory = folder_below(options.below);
    ProgressBar progress(concat("selftest, seed ", options.chaos.seed));
    const auto result = or_fail(run_chaos(
        options.chaos, session.stop(), [&](int offered) { progress.update(offered, options.chaos.sets); }));
    survived = survived && result.survived();
    if (options.json)
      all.push_back(json_of(options.chaos, result));
    else
      print(options.chaos, result);
    std::error_code ignored;
    if (result.survived())
      std::filesystem::remove_all(options.chaos.directory, ignored);
    else
      std::cerr << "log and data are kept in " << options.chaos.directory.string() << '\n';
  }
  if (options.json) std::cout << (options.repeat == 1 ? all[0] : all).dump(2) << '\n';
  if (!survived)
    throw CommandFailure{ExitCode::Failed, "the self-test failed (see above) report it with the log"};
}

}  // namespace

void add_selftest(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  options->below = std::filesystem::temp_directory_path();
  ChaosOptions& o = options->chaos;
  auto* command =
      app.add_subcommand("selftest", "Kill, cut and freeze the pipeline's programs; nothing may be lost");
  command->add_flag("--chaos", options->is_chaos, "A capture while programs die at random moments");
  command->add_option("--seed", o.seed, "Of the moments")->capture_default_str();
  command->add_option("--repeat", options->repeat, "With so many seeds, one after the other")
      ->check(CLI::Range(1, 10'000))
      ->capture_default_str();
  command->add_option("--sets", o.sets, "Pulses")->check(CLI::Range(1, 100'000))->capture_default_str();
  command->add_option("--rate-hz", o.rate_hz, "Of the pulses")
      ->check(CLI::Range(0.1, 1000.0))
      ->capture_default_str();
  command->add_option("--workers", o.workers, "Programs")->check(CLI::Range(1, 64))->capture_default_str();
  command->add_option("--folder", options->below, "Where to put the data")->capture_default_str();
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer("Example:\n  flamefield selftest --chaos --seed 7 --json");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
