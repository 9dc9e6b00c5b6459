#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/progress.h"

namespace flamefield {

namespace {

struct Options {
  DataOption data;
  std::int64_t pulses = 30;
  std::int64_t pre_pulses = 0;
  bool json = false;
};

void print(const CaptureState& state, bool as_json) {
  std::int64_t lost = 0;
  for (const auto& camera : state.cameras) {
    for (const auto& [cause, count] : camera.losses) lost += count;
  }
  if (as_json) {
    std::cout << nlohmann::ordered_json{{"capture", state.id},
                                        {"kind", name_of(state.kind)},
                                        {"sets", state.sets},
                                        {"sets_stored", state.sets_stored},
                                        {"pre_pulses", state.pre_pulses},
                                        {"frames_lost", lost},
                                        {"trouble", state.trouble}}
                     .dump(2)
              << '\n';
    return;
  }
  std::cout << state.id << ": " << state.sets_stored << " sets stored, " << lost << " frames lost";
  if (state.pre_pulses > 0) std::cout << ", " << state.pre_pulses << " of the sets from before the command";
  std::cout << '\n';
  if (lost > 0) std::cout << "see 'flamefield runs receipt " << state.id << "'\n";
}

// A capture that storing has ended is told as a failure, however many sets are safe.
void report(const CaptureState& state, bool as_json) {
  print(state, as_json);
  if (!state.trouble.empty()) throw CommandFailure{ExitCode::Failed, state.trouble};
}

void run(CaptureKind kind, const Options& options, const Session& session) {
  Connection connection = connect_to(options.data);
  ProgressBar bar(concat("capture ", name_of(kind)));
  const auto state = or_fail(connection.operating.capture(
      {.kind = kind,
       .pulses = kind == CaptureKind::Live ? 0 : options.pulses,
       .pre_pulses = options.pre_pulses},
      [&](std::int64_t done, std::int64_t total) {
        bar.update(static_cast<double>(done), static_cast<double>(total), concat(done, " sets"));
      },
      session.stop()));
  report(state, options.json);
}

void stop_capture(const Options& options) {
  Connection connection = connect_to(options.data);
  report(or_fail(connection.operating.acquisition().ask_for<CaptureState>(StopCapture{},
                                                                          std::chrono::seconds(120))),
         options.json);
}

void stand_by(const Options& options) {
  Connection connection = connect_to(options.data);
  const auto state =
      or_fail(connection.operating.acquisition().ask_for<CaptureState>(StandBy{}, std::chrono::seconds(30)));
  if (options.json) {
    std::cout << nlohmann::ordered_json{{"phase", name_of(state.phase)}, {"sets_held", state.sets_held}}.dump(
                     2)
              << '\n';
  } else {
    std::cout << "standing by: the last pulses are kept, none is stored\n";
  }
}

void add_kind(CLI::App& parent, Session& session, CaptureKind kind, const std::string& help,
              std::int64_t pulses) {
  auto options = std::make_shared<Options>();
  options->pulses = pulses;
  auto* command = parent.add_subcommand(std::string(name_of(kind)), help);
  add_data(*command, options->data);
  if (kind != CaptureKind::Live) {
    command->add_option("--pulses", options->pulses, "Trigger pulses to record")
        ->check(CLI::Range(1, 1'000'000))
        ->capture_default_str();
  }
  if (kind == CaptureKind::Burst) {
    command
        ->add_option("--pre-pulses", options->pre_pulses,
                     "Pulses from before this command, that standby has kept")
        ->check(CLI::Range(0, 100'000));
  }
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(concat("Example:\n  flamefield capture ", name_of(kind),
                         kind == CaptureKind::Live ? "" : " --pulses 30"));
  command->callback([=, &session] { session.choose([=, &session] { run(kind, *options, session); }); });
}

}  // namespace

void add_capture(CLI::App& app, Session& session) {
  auto* capture = app.add_subcommand("capture", "Record frame sets with the camera array");
  capture->require_subcommand(1);
  add_kind(*capture, session, CaptureKind::Dark, "Lens caps on: the sensors' dark level", 20);
  add_kind(*capture, session, CaptureKind::Background, "No flame: stray light and reflections", 20);
  add_kind(*capture, session, CaptureKind::Flat, "Evenly lit: vignetting and pixel response", 20);
  add_kind(*capture, session, CaptureKind::Board, "Calibration board, one pose a pulse", 24);
  add_kind(*capture, session, CaptureKind::Burst, "The flame", 30);
  add_kind(*capture, session, CaptureKind::Live, "Until 'flamefield stop' or Ctrl-C", 0);

  auto standby_options = std::make_shared<Options>();
  auto* standby = capture->add_subcommand(
      "standby", "See every pulse, keep the last ones in memory, store none: for 'burst --pre-pulses'");
  add_data(*standby, standby_options->data);
  standby->add_flag("--json", standby_options->json, "Print the result as JSON");
  standby->footer(
      "Example:\n  flamefield capture standby\n  flamefield capture burst --pulses 100 --pre-pulses 20");
  standby->callback([standby_options, &session] { session.choose([=] { stand_by(*standby_options); }); });

  auto options = std::make_shared<Options>();
  auto* stop = app.add_subcommand("stop", "End the running capture; what was triggered is stored first");
  add_data(*stop, options->data);
  stop->add_flag("--json", options->json, "Print the result as JSON");
  stop->footer("Example:\n  flamefield stop");
  stop->callback([options, &session] { session.choose([=] { stop_capture(*options); }); });
}

}  // namespace flamefield
