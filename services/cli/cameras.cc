#include <CLI/CLI.hpp>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>

#include "acquire/camera_array.h"
#include "acquire/discovery.h"
#include "services/cli/commands.h"
#include "services/config/lab_config.h"
#include "services/serve/lab_cameras.h"

namespace flamefield {

namespace {

using std::chrono::milliseconds;

struct Options {
  std::filesystem::path config;
  std::vector<std::string> addresses;
  int pictures = 3;
  bool json = false;
};

LabConfig configuration(const Options& options) {
  LabConfig lab = options.config.empty() ? LabConfig{} : or_usage(read_lab_config(options.config));
  for (const std::string& address : options.addresses) lab.cameras.push_back({address, address, {}});
  return lab;
}

// Those of lab.toml and on the command line are asked one by one; a broadcast finds the others.
std::vector<DiscoveredCamera> find_cameras(const LabConfig& lab) {
  std::vector<DiscoveredCamera> found = discover_all(milliseconds(1000));
  for (const LabCamera& camera : lab.cameras) {
    const auto is_known = [&](const DiscoveredCamera& other) { return other.address == camera.address; };
    if (camera.address.empty() || std::any_of(found.begin(), found.end(), is_known)) continue;
    if (const auto answer = discover_at(camera.address, milliseconds(600))) found.push_back(*answer);
  }
  return found;
}

void list(const Options& options, const Session& session) {
  const auto cameras = find_cameras(configuration(options));
  session.check_stop();
  const Result<> differ = check_addresses_differ(cameras);
  if (options.json) {
    auto all = nlohmann::ordered_json::array();
    for (const DiscoveredCamera& camera : cameras) {
      all.push_back({{"name", camera.user_name},
                     {"serial", camera.serial},
                     {"address", camera.address},
                     {"mac", camera.mac},
                     {"vendor", camera.vendor},
                     {"model", camera.model}});
    }
    std::cout << all.dump(2) << '\n';
    return or_fail(differ);
  }
  std::cout << std::left << std::setw(12) << "NAME" << std::setw(14) << "SERIAL" << std::setw(17) << "ADDRESS"
            << std::setw(19) << "MAC"
            << "MODEL\n";
  for (const DiscoveredCamera& camera : cameras) {
    std::cout << std::setw(12) << camera.user_name << std::setw(14) << camera.serial << std::setw(17)
              << camera.address << std::setw(19) << camera.mac << camera.vendor << ' ' << camera.model
              << '\n';
  }
  or_fail(differ);
}

// Opens all, sets and reads back what lab.toml says, and takes pictures by software.
void test(const Options& options, const Session& session) {
  const LabConfig lab = configuration(options);
  if (lab.cameras.empty()) {
    throw CommandFailure{
        ExitCode::Usage,
        "no cameras to test (none is named) use --config lab.toml, or --address 192.168.7.10"};
  }
  CameraSettings settings = settings_of(lab);
  settings.trigger_source = "Software";
  settings.action.reset();
  const auto array = or_fail(CameraArray::open(cameras_of(lab), settings));
  const BandwidthPlan plan = or_usage(array->share_link(bandwidth_needs_of(lab)));
  if (!options.json) {
    std::cout << "all pictures of a pulse take " << std::fixed << std::setprecision(1) << plan.burst_ms
              << " of the " << plan.period_ms << " ms between pulses; up to " << plan.most_rate_hz << " Hz\n";
    for (const std::string& warning : plan.warnings) std::cout << "warning: " << warning << '\n';
  }
  or_fail(array->start({.capture = "test"}, [](const FrameSet&) {}));
  for (int i = 0; i < options.pictures; ++i) {
    session.check_stop();
    or_fail(array->software_trigger());
    const auto deadline = std::chrono::steady_clock::now() + milliseconds(1500);
    while (array->progress().sets <= i && std::chrono::steady_clock::now() < deadline)
      array->wait_done(milliseconds(5));
  }
  const CaptureReport report = array->stop();
  bool all_well = report.pulses == options.pictures;
  auto rows = nlohmann::ordered_json::array();
  for (const CameraReceipt& camera : report.cameras) {
    all_well = all_well && camera.tally.delivered == options.pictures;
    rows.push_back({{"name", camera.camera},
                    {"pictures", camera.tally.delivered},
                    {"wanted", options.pictures},
                    {"packets_sent_again", camera.stream.resent_packets}});
    if (!options.json) {
      std::cout << camera.camera << ": " << camera.tally.delivered << " of " << options.pictures
                << " pictures, " << camera.stream.resent_packets << " packets sent again\n";
    }
  }
  if (options.json) std::cout << rows.dump(2) << '\n';
  if (!all_well)
    throw CommandFailure{ExitCode::Failed, "pictures are missing (see above) run 'flamefield doctor'"};
}

}  // namespace

void add_cameras(CLI::App& app, Session& session) {
  auto* cameras = app.add_subcommand("cameras", "The cameras on the network");
  cameras->require_subcommand(1);
  const auto add = [&](const char* name, const char* help, auto work) {
    auto options = std::make_shared<Options>();
    auto* command = cameras->add_subcommand(name, help);
    command->add_option("--config", options->config, "lab.toml with the cameras");
    command->add_option("--address", options->addresses, "More cameras, by IP address");
    command->add_flag("--json", options->json, "Print as JSON");
    if (std::string_view(name) == "test") {
      command->add_option("--pictures", options->pictures, "Of each camera")
          ->check(CLI::Range(1, 1000))
          ->capture_default_str();
    }
    command->footer(concat("Example:\n  flamefield cameras ", name, " --config lab.toml"));
    command->callback([=, &session] { session.choose([=, &session] { work(*options, session); }); });
  };
  add("list", "What answers a broadcast, and the cameras of lab.toml", list);
  add("test", "Open all, set them, read back, take pictures by software trigger", test);
}

}  // namespace flamefield
