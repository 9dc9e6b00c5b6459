#include <CLI/CLI.hpp>
#include <iostream>

#include "proto/check.h"
#include "proto/version.h"
#include "services/bus/keys.h"
#include "services/dispatcher/dispatcher.h"
#include "services/log/log.h"
#include "services/process/signals.h"

namespace flamefield {
namespace {

int fail(const Error& error) {
  std::cerr << error.message << "\n";
  return error.code == ErrorCode::InvalidInput ? 2 : 1;
}

int serve(const DispatcherOptions& options, const std::string& keys_dir) {
  const SignalStop stop;
  const auto keys =
      KeyRing::open_or_create(keys_dir.empty() ? options.data_dir / "keys" : std::filesystem::path(keys_dir));
  if (!keys) return fail(keys.error());
  Bus bus(*keys);
  auto dispatcher = Dispatcher::open(bus, options);
  if (!dispatcher) return fail(dispatcher.error());
  const auto end = (*dispatcher)->run(stop.token());
  log_event(LogLevel::Info, "dispatcher-stopped");
  return end ? 0 : fail(end.error());
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  using namespace flamefield;
  CLI::App app{
      "Takes frame sets in and hands work out to flamefield-worker.\n"
      "Example: flamefield-dispatchd --data /srv/flamefield --endpoint tcp://0.0.0.0:27600"};
  DispatcherOptions options;
  options.endpoints = {"tcp://127.0.0.1:27600"};
  options.event_endpoints = {"tcp://127.0.0.1:27601"};
  std::string data, keys;
  std::int64_t lease_ms = options.lease.count(), back_off_ms = options.back_off.count();
  app.add_option("--data", data, "directory of ledger, spool and volumes")->required();
  app.add_option("--endpoint", options.endpoints, "where producers, workers and clients connect");
  app.add_option("--events", options.event_endpoints, "where news are published");
  app.add_option("--keys", keys, "key directory (default: DATA/keys, made when missing)");
  app.add_option("--lease-ms", lease_ms, "a worker silent for longer loses its job")
      ->check(CLI::Range(100, 3'600'000));
  app.add_option("--back-off-ms", back_off_ms, "before a failed job is tried again")
      ->check(CLI::Range(0, 3'600'000));
  app.set_version_flag("--version", std::string(program_version()));
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& problem) {
    return app.exit(problem) == 0 ? 0 : 2;
  }
  options.data_dir = data;
  options.lease = std::chrono::milliseconds(lease_ms);
  options.back_off = std::chrono::milliseconds(back_off_ms);
  try {
    return serve(options, keys);
  } catch (const std::exception& defect) {
    std::cerr << "defect: " << defect.what() << "\n";
    return 1;
  }
}
