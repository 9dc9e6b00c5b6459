#include <CLI/CLI.hpp>
#include <iostream>

#include "proto/version.h"
#include "services/bus/keys.h"
#include "services/log/log.h"
#include "services/process/signals.h"
#include "services/worker/reconstruct_job.h"
#include "services/worker/worker.h"

namespace flamefield {
namespace {

int fail(const Error& error) {
  std::cerr << error.message << "\n";
  return error.code == ErrorCode::InvalidInput ? 2 : 1;
}

int serve(const WorkerOptions& options, const std::string& keys_dir) {
  const SignalStop stop;
  const auto keys =
      KeyRing::open(keys_dir.empty() ? options.data_dir / "keys" : std::filesystem::path(keys_dir), "worker");
  if (!keys) return fail(keys.error());
  Bus bus(*keys);
  Worker worker(bus, options, make_reconstruct_step({options.data_dir, options.threads}));
  const auto end = worker.run(stop.token());
  log_event(LogLevel::Info, "worker-stopped");
  return end ? 0 : fail(end.error());
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  using namespace flamefield;
  CLI::App app{
      "Reconstructs what flamefield-dispatchd hands out.\n"
      "Example: flamefield-worker --data /srv/flamefield --endpoint tcp://control:27600 --threads 4"};
  WorkerOptions options;
  options.endpoint = "tcp://127.0.0.1:27600";
  std::string data, keys;
  std::int64_t heartbeat_ms = options.heartbeat.count();
  app.add_option("--data", data, "the dispatcher's data directory, as this machine sees it")->required();
  app.add_option("--endpoint", options.endpoint, "of the dispatcher");
  app.add_option("--keys", keys, "directory with worker.key and dispatcher.pub (default: DATA/keys)");
  app.add_option("--threads", options.threads, "for the mathematics (default: all)")
      ->check(CLI::Range(0, 4096));
  app.add_option("--name", options.name, "in the ledger (default: from host and process)");
  app.add_option("--heartbeat-ms", heartbeat_ms, "well below a third of the lease")
      ->check(CLI::Range(10, 600'000));
  app.set_version_flag("--version", std::string(program_version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  options.data_dir = data;
  options.heartbeat = std::chrono::milliseconds(heartbeat_ms);
  try {
    return serve(options, keys);
  } catch (const std::exception& defect) {
    std::cerr << "defect: " << defect.what() << "\n";
    return 1;
  }
}
