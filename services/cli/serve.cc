#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <iostream>
#include <thread>

#include "reconstruct/solver.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/progress.h"
#include "services/config/lab_config.h"
#include "services/config/recipe_file.h"
#include "services/ledger/reader.h"
#include "services/serve/embedded.h"
#include "services/serve/lab_cameras.h"
#include "services/serve/live_planner.h"
#include "services/simulation/laboratory.h"
#include "services/store/rig_file.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path config, data, rig, recipe;
  std::optional<int> port;
  std::string first_address = "127.0.0.2";
};

LabConfig configuration(const Options& options) {
  LabConfig lab = options.config.empty() ? LabConfig{} : or_usage(read_lab_config(options.config));
  if (options.config.empty()) {  // the simulated ring looks at a point 40 mm above the burner
    lab.domain = centred_grid(52, 55, 52, 1.32);
    lab.domain.origin_mm.y() += 40;
  }
  if (!options.data.empty()) lab.data_directory = options.data;
  if (!options.rig.empty()) lab.rig = options.rig;
  if (!options.recipe.empty()) lab.recipe = options.recipe;
  if (options.port) lab.http_port = *options.port;
  return lab;
}

// The simulated laboratory in place of real cameras, when lab.toml names none.
std::unique_ptr<Laboratory> simulated(const LabConfig& lab, const Options& options) {
  LaboratoryOptions laboratory;
  laboratory.cameras = lab.simulated_cameras;
  laboratory.rate_hz = lab.trigger_rate_hz;
  laboratory.seed = lab.simulator_seed;
  laboratory.first_address = options.first_address;
  laboratory.height_mm = 0.5 * (lab.domain.lower_mm() + lab.domain.upper_mm()).y();
  laboratory.film.grid = lab.domain;
  laboratory.film.seed = lab.simulator_seed;
  laboratory.film.frames = 10;
  if (const auto kind = phantom_kind_from_name(lab.simulated_flame)) {
    laboratory.film.kind = *kind;
  } else {
    throw CommandFailure{ExitCode::Usage, concat("simulator.flame = '", lab.simulated_flame,
                                                 "' (no such phantom) see 'flamefield phantom --help'")};
  }
  return or_fail(Laboratory::open(laboratory));
}

CalibrationServiceOptions calibration_of(const LabConfig& lab) {
  CalibrationServiceOptions out;
  out.board = lab.board;
  out.reference_centre_mm = lab.reference_centre_mm;
  out.reference_azimuth_rad = lab.reference_azimuth_rad;
  out.volume = {lab.volume_centre_mm, lab.volume_diameter_mm, lab.volume_height_mm};
  return out;
}

// The simulated laboratory knows its board, and someone there who turns it when the session is done with a
// pose.
CalibrationServiceOptions calibration_in(Laboratory& laboratory, CalibrationServiceOptions out) {
  out.board = laboratory.board();
  const Rigid3& reference = laboratory.world_from_reference_board();
  const Eigen::Vector3d face = -reference.rotation.col(2);
  out.reference_centre_mm = out.volume.centre_mm = reference.translation_mm;
  out.reference_azimuth_rad = std::atan2(face.z(), face.x());
  out.show_next_pose = [&laboratory] { laboratory.turn_board(); };
  return out;
}

// The rig that bursts are reconstructed with: of lab.toml or --rig, else of the newest accepted calibration
// of these cameras. Empty: none.
std::string rig_in_use(const LabConfig& lab, const AcquisitionOptions& array, Client& dispatcher) {
  if (!lab.rig.empty()) {
    const Rig rig = or_usage(read_rig(lab.rig));
    return or_fail(dispatcher.ask_for<RigStored>(PutRig{rig}, std::chrono::seconds(10))).rig_id;
  }
  auto ledger = LedgerReader::open(lab.data_directory);
  if (!ledger) return "";
  const auto accepted = or_fail(ledger->calibrations());
  if (accepted.empty()) return "";
  const Rig rig = or_fail(ledger->rig(accepted.back().rig_id));
  const bool is_of_these = std::ranges::all_of(
      array.cameras, [&](const CameraAddress& camera) { return rig.find(camera.name).has_value(); });
  return is_of_these ? accepted.back().rig_id : "";
}

LivePlanner live_planner(const LabConfig& lab, const std::string& rig_id, Client dispatcher,
                         const Laboratory* laboratory) {
  Processing processing;
  processing.rig_id = rig_id;
  processing.grid = lab.domain;
  processing.recipe = lab.recipe.empty() ? live_recipe() : or_usage(read_recipe(lab.recipe, validate_recipe));
  if (laboratory && !processing.recipe.settings.contains("prepare.counts_per_unit")) {
    processing.recipe.settings["prepare.counts_per_unit"] =
        laboratory->film().electrons_per_unit() * laboratory->grey_levels_per_electron(lab.pixel_format);
  }
  LivePlanner planner(std::move(dispatcher), processing);
  or_fail(planner.start());
  return planner;
}

void run(const Options& options, const Session& session) {
  const LabConfig lab = configuration(options);
  if (!lab.rig.empty()) (void)or_usage(read_rig(lab.rig));  // before anything starts
  const Endpoints endpoints = or_usage(endpoints_of(lab.data_directory));
  const KeyRing keys =
      or_fail(KeyRing::open_or_create(lab.keys_directory.empty() ? endpoints.keys : lab.keys_directory));
  Bus bus(keys);

  EmbeddedOptions embedded;
  embedded.acquisition = acquisition_of(lab);
  embedded.data_dir = lab.data_directory;
  embedded.http_host = lab.http_host;
  embedded.http_public_name = lab.http_public_name;
  embedded.http_port = lab.http_port;
  embedded.workers = lab.workers;
  embedded.threads_per_worker = lab.threads_per_worker;
  embedded.dispatcher_endpoints.push_back(endpoints.dispatcher);
  embedded.event_endpoints.push_back(endpoints.events);
  embedded.acquisition.endpoints.push_back(endpoints.acquisition);
  embedded.calibration = calibration_of(lab);
  embedded.calibration.endpoints.push_back(endpoints.calibration);
  if (!lab.dispatcher_endpoint.empty()) embedded.dispatcher_endpoints.push_back(lab.dispatcher_endpoint);
  if (!lab.events_endpoint.empty()) embedded.event_endpoints.push_back(lab.events_endpoint);
  if (!lab.acquisition_endpoint.empty()) embedded.acquisition.endpoints.push_back(lab.acquisition_endpoint);

  std::unique_ptr<Laboratory> laboratory;
  if (embedded.acquisition.cameras.empty()) {
    laboratory = simulated(lab, options);
    embedded.acquisition.cameras = laboratory->cameras();
    CameraSettings settings = laboratory->camera_settings(lab.pixel_format);
    settings.region = embedded.acquisition.settings.region;
    settings.binning_x = lab.binning_x;
    settings.binning_y = lab.binning_y;
    embedded.acquisition.hooks = laboratory->hooks();
    if (lab.trigger_source == "action") {
      settings.trigger_source = embedded.acquisition.settings.trigger_source;
      settings.action = embedded.acquisition.settings.action;
      embedded.acquisition.hooks = {.before = embedded.acquisition.hooks.before, .armed = {}, .finished = {}};
    }
    embedded.acquisition.settings = settings;
    embedded.calibration = calibration_in(*laboratory, std::move(embedded.calibration));
  }
  const auto services = or_fail(Embedded::start(bus, embedded));
  if (laboratory) {
    ProgressBar bar("light the simulated flame");
    or_fail(laboratory->light_flame([&](int done, int total) { bar.update(done, total); }, session.stop()));
  }
  const auto dispatcher = [&] {
    return or_fail(Client::connect(bus, "operator", unique_name("planner"), "inproc://dispatcher"));
  };
  std::optional<LivePlanner> planner;
  auto asking = dispatcher();
  std::string rig = rig_in_use(lab, embedded.acquisition, asking);
  if (!rig.empty()) planner.emplace(live_planner(lab, rig, dispatcher(), laboratory.get()));
  auto operating = or_fail(Operator::connect(bus, "operator", "inproc://acquisition", "inproc://dispatcher"));

  std::cout << "serving " << lab.data_directory.string() << ": " << embedded.acquisition.cameras.size()
            << (laboratory ? " simulated" : "") << " cameras\n"
            << "live page " << services->page_url() << "\n"
            << (planner ? "" : "no rig: sets are stored, not reconstructed (--rig rig.yaml, or calibrate)\n")
            << "Ctrl-C drains and stops" << std::endl;
  while (!session.stop().stop_requested()) {
    if (const auto error = services->failed()) throw CommandFailure{ExitCode::Failed, error->message};
    if (const std::string accepted = services->accepted_rig(); !accepted.empty() && accepted != rig) {
      rig = accepted;  // bursts from now on are reconstructed with it
      if (planner)
        or_fail(planner->use_rig(rig));
      else
        planner.emplace(live_planner(lab, rig, dispatcher(), laboratory.get()));
    }
    if (planner) {
      if (const auto state =
              operating.acquisition().ask_for<CaptureState>(GetCapture{}, std::chrono::seconds(60))) {
        or_fail(planner->watch(*state));
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  }
}

}  // namespace

void add_serve(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command =
      app.add_subcommand("serve", "Everything in one process: cameras, storing, reconstruction, live page");
  command->add_option("--config", options->config, "lab.toml; without it a simulated array");
  command->add_option("--data", options->data, "Data folder (default flamefield-data, or as in lab.toml)");
  command->add_option("--rig", options->rig, "rig.yaml: reconstruct every set of a burst as it comes");
  command->add_option("--recipe", options->recipe, "Recipe of those reconstructions");
  command->add_option("--port", options->port, "Of the live page on 127.0.0.1; 0: any free one")
      ->check(CLI::Range(0, 65535));
  command
      ->add_option("--first-address", options->first_address,
                   "Loopback address of the first simulated camera")
      ->capture_default_str();
  command->footer(
      "Examples:\n"
      "  flamefield serve\n"
      "  flamefield serve --config /etc/flamefield/lab.toml\n"
      "  flamefield serve --rig rig.yaml, then in another terminal: flamefield capture burst --pulses 30");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
