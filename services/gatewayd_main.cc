#include <CLI/CLI.hpp>

#include "services/api/pages.h"
#include "services/bus/keys.h"
#include "services/log/log.h"
#include "services/process/daemon.h"
#include "services/process/signals.h"
#include "services/serve/endpoints.h"

namespace flamefield {
namespace {

struct Arguments {
  std::filesystem::path data, keys, report;
  std::string dispatcher, acquisition, calibration, public_name;
  std::uint16_t port = 8080;
};

Result<> serve(const Arguments& arguments) {
  const SignalStop stop;
  const auto endpoints = endpoints_of(arguments.data);
  if (!endpoints) return tl::unexpected(endpoints.error());
  const auto keys = KeyRing::open(arguments.keys.empty() ? endpoints->keys : arguments.keys, "operator");
  if (!keys) return tl::unexpected(keys.error());
  Bus bus(*keys);
  HttpServerOptions http;
  http.port = arguments.port;
  http.public_name = arguments.public_name;
  auto pages = Pages::open(
      bus, http,
      {.role = "operator",
       .acquisition = arguments.acquisition.empty() ? endpoints->acquisition : arguments.acquisition,
       .dispatcher = arguments.dispatcher.empty() ? endpoints->dispatcher : arguments.dispatcher,
       .data_dir = arguments.data,
       .calibration = arguments.calibration.empty() ? endpoints->calibration : arguments.calibration},
      arguments.report);
  if (!pages) return tl::unexpected(pages.error());
  log_event(LogLevel::Info, "gateway-started", {{"url", (*pages)->url()}});
  (*pages)->run(stop.token());
  return {};
}

}  // namespace
}  // namespace flamefield

int main(int argc, char** argv) {
  CLI::App app{
      "Serves the live page and its API on 127.0.0.1.\n"
      "Example: flamefield-gatewayd --data /srv/flamefield --port 8080",
      "flamefield-gatewayd"};
  flamefield::Arguments arguments;
  app.add_option("--data", arguments.data, "the installation's data directory")->required();
  app.add_option("--port", arguments.port, "of the page; 0: any free one")->capture_default_str();
  app.add_option("--public-name", arguments.public_name, "of a reverse proxy in front, see deploy/proxy");
  app.add_option("--report", arguments.report, "a report to link from the page");
  app.add_option("--dispatcher", arguments.dispatcher, "default: DATA/run/dispatcher.sock");
  app.add_option("--acquisition", arguments.acquisition, "default: DATA/run/acquisition.sock");
  app.add_option("--calibration", arguments.calibration, "default: DATA/run/calibration.sock");
  app.add_option("--keys", arguments.keys, "key directory (default: DATA/keys)");
  return flamefield::run_daemon(app, argc, argv, [&] { return flamefield::serve(arguments); });
}
