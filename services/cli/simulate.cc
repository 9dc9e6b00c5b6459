#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "services/cli/commands.h"
#include "services/cli/options.h"
#include "services/cli/progress.h"
#include "services/simulation/laboratory.h"

namespace flamefield {

namespace {

struct Options {
  LaboratoryOptions laboratory;
  std::string flame = "stratified";
  std::string show = "burst";
  std::vector<std::string> faults;
  bool json = false;
};

// "cam03:missed@12", "all:loss@0.005"
void script_faults(const std::vector<std::string>& texts, SimulatedArray& array) {
  const auto names = array.names();
  std::vector<CameraFaults> faults(names.size());
  for (const std::string& text : texts) {
    const std::size_t colon = text.find(':');
    const std::string camera = text.substr(0, colon);
    bool is_known = false;
    for (std::size_t i = 0; i < names.size() && colon != std::string::npos; ++i) {
      if (camera != "all" && camera != names[i]) continue;
      is_known = true;
      or_usage(add_fault(text.substr(colon + 1), faults[i]));
    }
    if (!is_known) {
      throw CommandFailure{ExitCode::Usage,
                           concat("fault '", text, "' (no such camera) write CAMERA:KIND@PULSE, e.g. ",
                                  names[0], ":missed@12 or all:loss@0.005")};
    }
  }
  for (std::size_t i = 0; i < faults.size(); ++i) array.set_faults(i, faults[i]);
}

void print_addresses(const Laboratory& laboratory, bool as_json) {
  const auto names = laboratory.array().names(), addresses = laboratory.array().addresses(),
             serials = laboratory.array().serials();
  nlohmann::ordered_json all = nlohmann::ordered_json::array();
  for (std::size_t i = 0; i < names.size(); ++i) {
    all.push_back({{"name", names[i]}, {"serial", serials[i]}, {"address", addresses[i]}});
    if (!as_json) std::cout << names[i] << "  serial " << serials[i] << "  address " << addresses[i] << '\n';
  }
  if (as_json) std::cout << all.dump(2) << '\n';
  std::cout << std::flush;
}

void run(Options& options, const Session& session) {
  const auto kind = capture_kind_from_name(options.show);
  const auto flame = phantom_kind_from_name(options.flame);
  if (!kind || !flame) {
    throw CommandFailure{ExitCode::Usage,
                         concat("nothing called '", kind ? options.flame : options.show,
                                "' can be shown (unknown name) see 'flamefield simulate --help'")};
  }
  options.laboratory.film.kind = *flame;
  options.laboratory.film.seed = options.laboratory.seed;
  const auto laboratory = or_fail(Laboratory::open(options.laboratory));
  {
    ProgressBar bar("light the simulated flame");
    or_fail(laboratory->light_flame([&](int done, int total) { bar.update(done, total); }, session.stop()));
  }
  laboratory->show(*kind);
  script_faults(options.faults, laboratory->array());
  laboratory->array().generator().start(options.laboratory.rate_hz, 0);
  print_addresses(*laboratory, options.json);
  while (!session.stop().stop_requested()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  laboratory->array().generator().stop();
}

}  // namespace

void add_simulate(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  LaboratoryOptions& laboratory = options->laboratory;
  laboratory.film.frames = 10;
  laboratory.film.grid = centred_grid(52, 55, 52, 1.32);
  laboratory.film.grid.origin_mm.y() += laboratory.height_mm;
  auto* command = app.add_subcommand(
      "simulate",
      "The simulated camera array alone, for any GigE Vision client; the trigger runs all the time");
  command->add_option("--cameras", laboratory.cameras, "GigE Vision devices")
      ->check(CLI::Range(1, 64))
      ->capture_default_str();
  command->add_option("--rate-hz", laboratory.rate_hz, "Of the signal generator")
      ->check(CLI::Range(0.1, 100.0))
      ->capture_default_str();
  command
      ->add_option("--show", options->show,
                   "What the cameras see: burst (the flame), board, dark, background, flat")
      ->capture_default_str();
  command->add_option("--flame", options->flame, "Phantom that burns: stratified bunsen swirl torus ...")
      ->capture_default_str();
  command->add_option("--first-address", laboratory.first_address, "Loopback address of the first camera")
      ->capture_default_str();
  command->add_option("--seed", laboratory.seed, "Of flame, noise and mounting tolerances")
      ->capture_default_str();
  command->add_option(
      "--fault", options->faults,
      "CAMERA:KIND@PULSE or @FIRST-LAST; KIND: missed unseen extra drop leader trailer mute reorder "
      "duplicate repeat corrupt delay dead cut, or loss@SHARE; CAMERA may be all");
  command
      ->add_option("--link-mbit", laboratory.link_mbit_per_s,
                   "Of each camera's network port; 0: as fast as it goes")
      ->check(CLI::Range(0.0, 1e5))
      ->capture_default_str();
  command->add_flag("--broadcast", laboratory.answers_broadcasts,
                    "Answer discovery broadcasts, as other programs send them; one array a machine can");
  command->add_flag("--json", options->json, "Print names, serials and addresses as JSON");
  command->footer(
      "Example:\n  flamefield simulate --cameras 3 --rate-hz 2\n  arv-tool-0.8 -a 127.0.0.2 control Width\n"
      "  flamefield simulate --fault cam03:missed@12 --fault all:loss@0.005");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
