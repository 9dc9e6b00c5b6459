#include <CLI/CLI.hpp>

#include "services/bus/keys.h"
#include "services/dispatcher/dispatcher.h"
#include "services/process/daemon.h"
#include "services/process/signals.h"
#include "services/serve/endpoints.h"
#include "services/serve/reprocessing.h"

namespace flamefield {
namespace {

Result<> serve(DispatcherOptions options, const std::filesystem::path& keys_dir) {
  const SignalStop stop;
  const auto local = endpoints_of(options.data_dir);
  if (!local) return tl::unexpected(local.error());
  options.endpoints.push_back(local->dispatcher);
  options.event_endpoints.push_back(local->events);
  const auto keys = KeyRing::open_or_create(keys_dir.empty() ? local->keys : keys_dir);
  if (!keys) return tl::unexpected(keys.error());
  Bus bus(*keys);
  options.endpoints.push_back("inproc://dispatcher");
  auto dispatcher = Dispatcher::open(bus, options);
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  const std::jthread scheduler([&](std::stop_token scheduler_stop) {
    (void)make_scheduler(bus, "inproc://dispatcher", options.data_dir).run(scheduler_stop);
  });
  return (*dispatcher)->run(stop.token());
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  using namespace flamefield;
  CLI::App app{
      "Takes frame sets in and hands work out to flamefield-worker.\n"
      "Example: flamefield-dispatchd --data /srv/flamefield --endpoint tcp://0.0.0.0:27600",
      "flamefield-dispatchd"};
  DispatcherOptions options;
  options.endpoints.clear();  // the sockets of the data directory are always there
  options.event_endpoints.clear();
  std::filesystem::path keys;
  std::int64_t lease_ms = options.lease.count(), back_off_ms = options.back_off.count();
  app.add_option("--data", options.data_dir, "directory of ledger, spool and volumes")->required();
  app.add_option("--endpoint", options.endpoints, "where other machines connect, e.g. tcp://0.0.0.0:27600");
  app.add_option("--events", options.event_endpoints, "where news are published for other machines");
  app.add_option("--keys", keys, "key directory (default: DATA/keys, made when missing)");
  std::uint64_t segment_mib = options.segment_bytes >> 20;
  app.add_option("--segment-mib", segment_mib, "the spool takes room in pieces of this size")
      ->check(CLI::Range(1, 65536))
      ->capture_default_str();
  app.add_option("--lease-ms", lease_ms, "a worker silent for longer loses its job")
      ->check(CLI::Range(100, 3'600'000))
      ->capture_default_str();
  app.add_option("--back-off-ms", back_off_ms, "before a failed job is tried again")
      ->check(CLI::Range(0, 3'600'000))
      ->capture_default_str();
  return run_daemon(app, argc, argv, [&] {
    options.segment_bytes = segment_mib << 20;
    options.lease = std::chrono::milliseconds(lease_ms);
    options.back_off = std::chrono::milliseconds(back_off_ms);
    return serve(options, keys);
  });
}
