#include "services/recording/recording.h"

#include <CLI/CLI.hpp>
#include <iostream>

#include "proto/utc.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/progress.h"
#include "services/ledger/query.h"
#include "services/ledger/reader.h"

namespace flamefield {

namespace {

struct Options {
  DataOption data;
  std::string capture, where;
  std::filesystem::path file;
  bool at_full_speed = false;
};

Bus open_bus(const Endpoints& endpoints, const std::string& role) {
  return Bus(or_usage(KeyRing::open(endpoints.keys, role)));
}

void export_capture(const Options& options, const Session& session) {
  if (options.file.extension() != ".nxs") {
    throw CommandFailure{ExitCode::Usage, concat("output '", options.file.string(),
                                                 "' (recordings are .nxs files) choose another name")};
  }
  auto ledger = or_usage(LedgerQuery::open(options.data.dir));
  (void)or_usage(parse_filter(options.where, 0, FilterOver::Sets));
  const std::string of_capture = concat("capture = \"", options.capture, "\"");
  const auto filter = or_usage(
      parse_filter(options.where.empty() ? of_capture : concat("(", options.where, ") and ", of_capture),
                   utc_now_ns(), FilterOver::Sets));
  const auto sets = or_fail(ledger.sets(filter));
  if (sets.empty()) {
    throw CommandFailure{ExitCode::Failed,
                         concat("capture '", options.capture,
                                "' (no such sets of it are stored) see 'flamefield runs list --captures'")};
  }
  const Endpoints endpoints = or_usage(endpoints_of(options.data.dir));
  Bus bus = open_bus(endpoints, "operator");
  auto client = or_fail(Client::connect(bus, "operator", unique_name("export"), endpoints.dispatcher));
  // What the cameras were set to goes with the pictures.
  Provenance provenance = {{"program_version", std::string(program_version())},
                           {"capture", options.capture},
                           {"command", session.command_line()}};
  const Receipt receipt = or_fail(or_fail(LedgerReader::open(options.data.dir)).receipt(options.capture));
  for (const auto& [name, value] : receipt.capture.settings) provenance["capture." + name] = value;
  ProgressBar bar(concat("export ", options.capture));
  or_fail(convert_capture(
      [&](std::int64_t index) -> Result<FrameSet> {
        auto data = client.ask_for<SetData>(FetchSet{sets[static_cast<std::size_t>(index)]},
                                            std::chrono::seconds(30));
        if (!data) return tl::unexpected(data.error());
        return std::move(data->set);
      },
      static_cast<std::int64_t>(sets.size()), options.file, provenance,
      [&](std::int64_t done, std::int64_t total) {
        bar.update(static_cast<double>(done), static_cast<double>(total), concat(done, " sets"));
      },
      session.stop()));
  std::cout << options.file.string() << ": " << sets.size() << " sets\n";
}

void replay_recording(const Options& options, const Session& session) {
  const auto recording = or_usage(FrameReader::open(options.file));
  const Endpoints endpoints = or_usage(endpoints_of(options.data.dir));
  Bus bus = open_bus(endpoints, "capture");
  ReplayOptions how;
  how.capture = options.capture.empty() ? concat("replay-", options.file.stem().string()) : options.capture;
  how.keeps_time = !options.at_full_speed;
  ProgressBar bar(concat("replay ", options.file.filename().string()));
  const auto report = or_fail(replay(
      recording, bus, endpoints.dispatcher, how,
      [&](std::int64_t done, std::int64_t total) {
        bar.update(static_cast<double>(done), static_cast<double>(total), concat(done, " sets"));
      },
      session.stop()));
  std::cout << how.capture << ": " << report.sets << " sets stored in " << report.seconds << " s\n";
}

}  // namespace

void add_export(CLI::App& runs, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command =
      runs.add_subcommand("export", "A capture as one .nxs file; goes on where it was interrupted");
  add_data(*command, options->data);
  command->add_option("CAPTURE", options->capture, "As 'runs list --captures' prints it")->required();
  command->add_option("--out", options->file, "Recording to write, .nxs")->required();
  command->add_option("--where", options->where, "Only these of its sets, e.g. 'losses = 0 and index < 100'");
  command->footer(
      "Examples:\n  flamefield runs export 20260301T101500000-burst --out burst.nxs\n"
      "  flamefield convert burst.nxs pictures/");
  command->callback(
      [options, &session] { session.choose([=, &session] { export_capture(*options, session); }); });
}

void add_replay(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand(
      "replay", "Send a recording through a running 'flamefield serve', in place of cameras");
  add_data(*command, options->data);
  command->add_option("RECORDING", options->file, "Made by 'flamefield runs export'")->required();
  command->add_option("--as", options->capture, "Name of the new capture");
  command->add_flag("--full-speed", options->at_full_speed,
                    "As fast as it can be stored, not as it was taken");
  command->footer("Example:\n  flamefield replay burst.nxs --as second-look --full-speed");
  command->callback(
      [options, &session] { session.choose([=, &session] { replay_recording(*options, session); }); });
}

}  // namespace flamefield
