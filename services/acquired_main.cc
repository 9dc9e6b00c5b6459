#include <CLI/CLI.hpp>

#include "services/acquisition/acquisition.h"
#include "services/bus/keys.h"
#include "services/config/lab_config.h"
#include "services/log/log.h"
#include "services/process/daemon.h"
#include "services/process/notify.h"
#include "services/process/signals.h"
#include "services/serve/endpoints.h"
#include "services/serve/lab_cameras.h"

namespace flamefield {
namespace {

// A program that was killed holds its cameras until their heartbeat, 3 s, runs out.
constexpr std::chrono::seconds kOpenPatience{8};

struct Arguments {
  std::filesystem::path config, data, keys;
  std::string dispatcher, endpoint;
};

Result<> serve(const Arguments& arguments) {
  const SignalStop stop;
  auto lab = read_lab_config(arguments.config);
  if (!lab) return tl::unexpected(lab.error());
  if (!arguments.data.empty()) lab->data_directory = arguments.data;
  const auto endpoints = endpoints_of(lab->data_directory);
  if (!endpoints) return tl::unexpected(endpoints.error());
  const auto keys = KeyRing::open_or_create(arguments.keys.empty() ? endpoints->keys : arguments.keys);
  if (!keys) return tl::unexpected(keys.error());
  Bus bus(*keys);

  AcquisitionOptions options = acquisition_of(*lab);
  options.open_patience = kOpenPatience;
  options.endpoints = {arguments.endpoint.empty() ? endpoints->acquisition : arguments.endpoint};
  options.dispatcher_endpoint = arguments.dispatcher.empty() ? endpoints->dispatcher : arguments.dispatcher;
  auto acquisition = Acquisition::open(bus, std::move(options));
  if (!acquisition) return tl::unexpected(acquisition.error());
  log_event(LogLevel::Info, "acquisition-started", {{"cameras", lab->cameras.size()}});
  const ServiceManagerNotice notice([&] { return (*acquisition)->silence() < std::chrono::seconds(60); });
  return (*acquisition)->run(stop.token());
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  CLI::App app{
      "Captures hardware-triggered frame sets and hands them to flamefield-dispatchd.\n"
      "Example: flamefield-acquired --config /etc/flamefield/lab.toml",
      "flamefield-acquired"};
  flamefield::Arguments arguments;
  app.add_option("--config", arguments.config, "lab.toml with the cameras")->required();
  app.add_option("--data", arguments.data, "the installation's data directory (default: as in lab.toml)");
  app.add_option("--dispatcher", arguments.dispatcher,
                 "where frame sets go (default: DATA/run/dispatcher.sock)");
  app.add_option("--endpoint", arguments.endpoint,
                 "where captures are asked for (default: DATA/run/acquisition.sock)");
  app.add_option("--keys", arguments.keys, "key directory (default: DATA/keys)");
  return flamefield::run_daemon(app, argc, argv, [&] { return flamefield::serve(arguments); });
}
