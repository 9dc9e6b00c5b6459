#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>

#include "services/api/records_json.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"
#include "services/cli/runs_commands.h"
#include "services/ledger/query.h"
#include "services/ledger/reader.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;

struct Options {
  DataOption data;
  std::string id;
  RunSelection selection;
  bool captures = false;
  bool json = false;
};

std::string inputs_text(const Run& run) {
  if (run.inputs.size() == 1) return concat(run.inputs.front().capture, " #", run.inputs.front().index);
  return concat(run.inputs.front().capture, " mean of ", run.inputs.size());
}

std::string metric_text(const Run& run, const char* name) {
  const auto found = run.metrics.find(name);
  return found == run.metrics.end() ? "-" : fmt::format("{:.4f}", found->second);
}

std::string state_text(const WorkRow& row) {
  if (row.stale) return "stale";
  if (row.retired && row.state == JobState::Done) return "retired";
  return std::string(name_of(row.state));
}

void print_captures(const std::vector<CaptureRow>& rows, bool as_json) {
  if (as_json) {
    Json all = Json::array();
    for (const CaptureRow& row : rows) all.push_back(json_of(row));
    std::cout << all.dump(2) << '\n';
    return;
  }
  std::cout << fmt::format("{:<32} {:<11} {:>7} {:>7} {:>8} {:>7}  {}\n", "CAPTURE", "KIND", "PULSES", "SETS",
                           "FRAMES", "LOSSES", "STARTED (UTC)");
  for (const CaptureRow& row : rows) {
    std::cout << fmt::format("{:<32} {:<11} {:>7} {:>7} {:>8} {:>7}  {}\n", row.capture.id,
                             name_of(row.capture.kind), row.capture.pulses, row.sets, row.frames, row.losses,
                             utc_text(row.capture.started_time_ns));
  }
}

void list(const Options& options) {
  if (options.captures)
    return print_captures(or_fail(or_fail(LedgerReader::open(options.data.dir)).captures()), options.json);
  const auto rows = options.selection.read(options.data.dir);
  if (options.json) {
    Json all = Json::array();
    for (const WorkRow& row : rows) all.push_back(json_of(row));
    std::cout << all.dump(2) << '\n';
    return;
  }
  std::cout << fmt::format("{:<48} {:<42} {:<7} {:<8} {:>5} {:>9} {:>8} {:>8}  {}\n", "RUN", "INPUT", "STATE",
                           "SOLVER", "ITER", "RESIDUAL", "SOLVE s", "PEARSON", "FINISHED (UTC)");
  std::int64_t stale = 0;
  for (const WorkRow& row : rows) {
    stale += row.stale ? 1 : 0;
    std::cout << fmt::format("{:<48} {:<42} {:<7} {:<8} {:>5} {:>9.4f} {:>8.2f} {:>8}  {}{}\n", row.run.id,
                             inputs_text(row.run), state_text(row), row.run.solver, row.run.iterations,
                             row.run.residual, row.run.timings.solve_s, metric_text(row.run, "pearson_3d"),
                             utc_text(row.run.finished_time_ns), row.reason.empty() ? "" : "  " + row.reason);
  }
  if (rows.empty()) std::cout << "no such runs: capture a burst, or reconstruct one that is stored\n";
  if (stale > 0)
    std::cout << stale << " are stale: a newer calibration counts for them; 'flamefield reprocess --stale "
              << "--dry-run' says what redoing them takes\n";
}

void show(const Options& options) {
  auto reader = or_fail(LedgerReader::open(options.data.dir));
  const RunRow row = or_fail(reader.run(options.id));
  Json json = json_of(row);
  if (options.json) {
    json["history"] = json_of(row.run.history);
    std::cout << json.dump(2) << '\n';
    return;
  }
  for (const auto& [key, value] : json.items()) {
    std::cout << fmt::format("{:<20} {}\n", key, value.is_string() ? value.get<std::string>() : value.dump());
  }
}

void receipt(const Options& options) {
  auto reader = or_fail(LedgerReader::open(options.data.dir));
  const Receipt found = or_fail(reader.receipt(options.id));
  if (options.json) {
    std::cout << json_of(found).dump(2) << '\n';
    return;
  }
  const PutCapture& capture = found.capture;
  std::cout << fmt::format("capture {} ({}), {}{}", capture.id, name_of(capture.kind),
                           capture.finished_time_ns == 0 ? "not closed" : name_of(capture.end),
                           capture.end_reason.empty() ? "" : ": " + capture.end_reason);
  if (capture.pre_pulses > 0)
    std::cout << fmt::format(", {} pulses from before the command", capture.pre_pulses);
  if (found.sets_not_stored > 0)
    std::cout << fmt::format("\n{} PULSES WERE SEEN BUT NOT STORED", found.sets_not_stored);
  std::cout << fmt::format("\n\n{:<10} {:>8} {:>8}  {}\n", "CAMERA", "PULSES", "FRAMES", "LOSSES");
  for (const auto& line : found.cameras) {
    std::string losses;
    for (const auto& [cause, count] : line.losses) losses += fmt::format("{} {}  ", count, cause);
    std::string besides;
    for (const auto& [name, count] : line.counters) {
      if (name != "frames-in" && name != "delivered") besides += fmt::format("{} {}  ", count, name);
    }
    std::cout << fmt::format("{:<10} {:>8} {:>8}  {}{}{}\n", line.camera, line.pulses, line.frames,
                             losses.empty() ? "none  " : losses, besides.empty() ? "" : "besides: " + besides,
                             line.balances() ? "" : "DOES NOT BALANCE");
  }
  std::cout << fmt::format("\nsets stored {} = volumes {} + failed {} + pending {} + not asked for {}",
                           found.sets, found.volumes, found.failed, found.pending, found.not_asked);
  if (found.combined_volumes > 0)
    std::cout << fmt::format("; volumes of several sets {}", found.combined_volumes);
  std::cout << (found.balances() ? "\nthe receipt balances\n" : "\nTHE RECEIPT DOES NOT BALANCE\n");
  for (const auto& failure : found.failures)
    std::cout << "failed " << failure.run_id << ": " << failure.reason << '\n';
}

CLI::App* add(CLI::App& parent, Session& session, const char* name, const char* help, const char* example,
              const std::shared_ptr<Options>& options, void (*work)(const Options&)) {
  auto* command = parent.add_subcommand(name, help);
  add_data(*command, options->data);
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(concat("Example:\n  flamefield runs ", example));
  command->callback([=, &session] { session.choose([=] { work(*options); }); });
  return command;
}

}  // namespace

void add_runs(CLI::App& app, Session& session) {
  auto* runs = app.add_subcommand("runs", "What was captured and reconstructed, from the ledger");
  runs->require_subcommand(1);
  auto options = std::make_shared<Options>();
  auto* list_command = add(*runs, session, "list", "All runs, or all captures",
                           "list --capture 20260301T101500000-burst", options, &list);
  add_selection(*list_command, options->selection);
  list_command->add_flag("--captures", options->captures, "List captures instead");

  options = std::make_shared<Options>();
  add(*runs, session, "show", "Everything about one run", "show RUN", options, &show)
      ->add_option("RUN", options->id, "As 'runs list' prints it")
      ->required();

  options = std::make_shared<Options>();
  add(*runs, session, "receipt", "Per camera: pulses = frames + losses; sets = volumes + failures",
      "receipt 20260301T101500000-burst", options, &receipt)
      ->add_option("CAPTURE", options->id, "As 'runs list --captures' prints it")
      ->required();
  add_export(*runs, session);
  add_compare(*runs, session);
  add_tag(*runs, session);
}

}  // namespace flamefield
