#include "services/doctor/doctor.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iomanip>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/cli/commands.h"
#include "services/config/lab_config.h"
#include "services/serve/lab_cameras.h"

namespace flamefield {

namespace {

struct Options {
  std::filesystem::path config, data;
  bool json = false;
  bool quick = false;
};

void print(const std::vector<Finding>& findings, bool as_json) {
  if (as_json) {
    auto all = nlohmann::ordered_json::array();
    for (const Finding& finding : findings) {
      all.push_back({{"subject", finding.subject},
                     {"health", name_of(finding.health)},
                     {"found", finding.found},
                     {"fix", finding.fix}});
    }
    std::cout << all.dump(2) << '\n';
    return;
  }
  for (const Finding& finding : findings) {
    std::cout << std::left << std::setw(10) << name_of(finding.health) << finding.subject << ": "
              << finding.found << '\n';
    if (!finding.fix.empty()) std::cout << "          fix: " << finding.fix << '\n';
  }
}

void run(const Options& options, const Session& session) {
  const LabConfig lab = options.config.empty() ? LabConfig{} : or_usage(read_lab_config(options.config));
  DoctorOptions doctor;
  doctor.cameras = cameras_of(lab);
  doctor.settings = settings_of(lab);
  doctor.bandwidth = bandwidth_needs_of(lab);
  doctor.data_directory = options.data.empty() ? lab.data_directory : options.data;
  doctor.writes_to_disk = !options.quick;
  const auto findings = examine(doctor);
  session.check_stop();
  print(findings, options.json);
  const auto bad = std::count_if(findings.begin(), findings.end(),
                                 [](const Finding& finding) { return finding.health == Health::Bad; });
  if (bad > 0) {
    throw CommandFailure{ExitCode::Failed,
                         concat(bad, " of ", findings.size(),
                                " checks are bad (frames would be lost) follow the fixes above")};
  }
}

}  // namespace

void add_doctor(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "doctor", "Looks for what makes captures lose frames: network, cameras, disk, clock; prints fixes");
  command->add_option("--config", options->config, "lab.toml with the cameras and the network");
  command->add_option("--data", options->data, "Folder that will be recorded to");
  command->add_flag("--quick", options->quick, "Do not measure the disk");
  command->add_flag("--json", options->json, "Print the findings as JSON");
  command->footer("Example:\n  flamefield doctor --config /etc/flamefield/lab.toml");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
