#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <iostream>
#include <nlohmann/json.hpp>
#include <thread>

#include "services/api/records_json.h"
#include "services/cli/commands.h"
#include "services/cli/connection.h"

namespace flamefield {

namespace {

struct Options {
  DataOption data;
  bool watch = false;
  bool json = false;
};

std::string text_of(const CaptureState& array, const Status& status) {
  std::string out = fmt::format("array      {}", name_of(array.phase));
  if (!array.id.empty()) {
    out += fmt::format(", capture {}: {} sets, {} stored", array.id, array.sets, array.sets_stored);
  }
  if (array.phase == CapturePhase::Standby)
    out += fmt::format("; the last {} pulses are kept", array.sets_held);
  if (!array.trouble.empty()) out += fmt::format("\nTROUBLE    {}", array.trouble);
  out += fmt::format("\njobs       {} waiting, {} running, {} done, {} failed\nstored     {} sets, {} runs\n",
                     status.queued, status.leased, status.done, status.failed, status.sets, status.runs);
  if (status.paused) out += "paused     everything, until 'flamefield jobs resume --all'\n";
  for (const auto& [priority, count] : status.queued_by_priority) {
    if (count > 0) out += fmt::format("waiting    {} {}\n", count, priority);
  }
  for (const auto& worker : status.workers) {
    out += fmt::format("worker     {} {} ({} threads, {:.1f} GiB)\n", worker.name,
                       worker.job_id == 0 ? "idle" : fmt::format("on job {}", worker.job_id), worker.threads,
                       static_cast<double>(worker.memory_mib) / 1024);
  }
  for (const auto& job : status.waiting) out += fmt::format("job {:<6} waits: {}\n", job.job_id, job.why);
  out += fmt::format("\n{:<8} {:<16} {:<10} {:>8} {:>8} {:>10}\n", "CAMERA", "ADDRESS", "STATE", "FRAMES",
                     "LOSSES", "AGE s");
  for (const auto& camera : array.cameras) {
    std::int64_t lost = 0;
    for (const auto& [cause, count] : camera.losses) lost += count;
    out += fmt::format("{:<8} {:<16} {:<10} {:>8} {:>8} {:>10}\n", camera.name, camera.address,
                       camera.connected ? "connected" : "LOST", camera.frames, lost,
                       camera.newest_age_s < 0 ? "-" : fmt::format("{:.1f}", camera.newest_age_s));
  }
  return out;
}

void run(const Options& options, const Session& session) {
  Connection connection = connect_to(options.data);
  do {
    const auto status =
        or_fail(connection.operating.dispatcher().ask_for<Status>(GetStatus{}, std::chrono::seconds(5)));
    const auto array = or_fail(
        connection.operating.acquisition().ask_for<CaptureState>(GetCapture{}, std::chrono::seconds(5)));
    if (options.json) {
      std::cout << nlohmann::ordered_json{{"array", json_of(array)}, {"dispatcher", json_of(status)}}.dump(2)
                << std::endl;
    } else {
      if (options.watch) std::cout << "\033[H\033[J";
      std::cout << text_of(array, status) << std::flush;
    }
    if (options.watch) std::this_thread::sleep_for(std::chrono::milliseconds(500));
  } while (options.watch && !session.stop().stop_requested());
}

}  // namespace

void add_status(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = app.add_subcommand("status", "What the cameras, the queue and the workers are doing");
  add_data(*command, options->data);
  command->add_flag("--watch", options->watch, "Repeat until Ctrl-C");
  command->add_flag("--json", options->json, "Print as JSON");
  command->footer("Example:\n  flamefield status --watch");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
