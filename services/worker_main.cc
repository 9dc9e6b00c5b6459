#include <CLI/CLI.hpp>
#include <cmath>

#include "services/bus/client.h"
#include "services/bus/keys.h"
#include "services/process/daemon.h"
#include "services/process/signals.h"
#include "services/process/supervisor.h"
#include "services/serve/endpoints.h"
#include "services/worker/reconstruct_job.h"
#include "services/worker/worker.h"

namespace flamefield {
namespace {

Result<> serve(WorkerOptions options, const std::filesystem::path& keys_dir, Life& life) {
  const SignalStop stop(true);
  const auto local = endpoints_of(options.data_dir);
  if (!local) return tl::unexpected(local.error());
  if (options.endpoint.empty()) options.endpoint = local->dispatcher;
  const auto keys = KeyRing::open(keys_dir.empty() ? local->keys : keys_dir, "worker");
  if (!keys) return tl::unexpected(keys.error());
  Bus bus(*keys);
  Worker worker(bus, options, make_reconstruct_step({options.data_dir, options.threads}));
  worker.watched_by(life.in_hand, {life.lost, life.death});
  return worker.run(stop.token(), stop.drain());
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  using namespace flamefield;
  CLI::App app{
      "Reconstructs what flamefield-dispatchd hands out.\n"
      "Example: flamefield-worker --data /srv/flamefield --threads 4",
      "flamefield-worker"};
  WorkerOptions options;
  options.endpoint.clear();
  std::filesystem::path keys;
  std::int64_t heartbeat_ms = options.heartbeat.count();
  double memory_gib = 0;
  app.add_option("--data", options.data_dir, "the dispatcher's data directory, as this machine sees it")
      ->required();
  app.add_option("--endpoint", options.endpoint, "of the dispatcher (default: DATA/run/dispatcher.sock)");
  app.add_option("--keys", keys, "directory with worker.key and dispatcher.pub (default: DATA/keys)");
  app.add_option("--threads", options.threads, "for the mathematics (default: all)")
      ->check(CLI::Range(0, 4096));
  app.add_option("--memory-gib", memory_gib,
                 "for jobs, which are matched to it (default: what the machine has)")
      ->check(CLI::Range(0.0, 1e6));
  app.add_option("--name", options.name, "in the ledger (default: from host and process)");
  app.add_option("--heartbeat-ms", heartbeat_ms, "well below a third of the lease")
      ->check(CLI::Range(10, 600'000))
      ->capture_default_str();
  std::int64_t idle_s = 0, silence_s = 0;
  app.add_flag("--own-memory", options.own_memory,
               "--memory-gib is not shared with this host's other workers");
  app.add_flag("--live-only", options.live_only, "take live work alone");
  app.add_option("--idle-s", idle_s, "end when there was no job for so long (default: never)")
      ->check(CLI::Range(0, 1'000'000));
  app.add_option("--silence-s", silence_s, "end when the dispatcher was silent for so long (default: never)")
      ->check(CLI::Range(0, 1'000'000));
  app.footer("SIGTERM gives the job in hand back, SIGUSR1 finishes it and takes no other.");
  options.name = unique_name("worker");  // kept from life to life
  return run_supervised_daemon(app, argc, argv, [&](Life& life) {
    options.heartbeat = std::chrono::milliseconds(heartbeat_ms);
    options.memory_mib = std::llround(1024 * memory_gib);
    options.idle_limit = std::chrono::seconds(idle_s);
    options.silence_limit = std::chrono::seconds(silence_s);
    return serve(options, keys, life);
  });
}
