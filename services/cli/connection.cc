#include "services/cli/connection.h"

#include <CLI/CLI.hpp>

#include "services/cli/app.h"

namespace flamefield {

void add_data(CLI::App& command, DataOption& data) {
  command.add_option("--data", data.dir, "Data folder of 'flamefield serve'")->capture_default_str();
}

namespace {

void check_served(const DataOption& data) {
  if (!std::filesystem::is_directory(data.dir / "keys")) {
    throw CommandFailure{ExitCode::Usage, concat("no services in ", data.dir.string(),
                                                 " (it holds no keys) start 'flamefield serve ", "--data ",
                                                 data.dir.string(), "', or name another folder with --data")};
  }
}

}  // namespace

Connection connect_to(const DataOption& data) {
  check_served(data);
  const Endpoints endpoints = or_usage(endpoints_of(data.dir));
  auto bus = std::make_unique<Bus>(or_usage(KeyRing::open(endpoints.keys, "operator")));
  auto operating = or_fail(Operator::connect(*bus, "operator", endpoints.acquisition, endpoints.dispatcher));
  return {std::move(bus), std::move(operating), endpoints};
}

DispatcherConnection connect_to_dispatcher(const DataOption& data) {
  check_served(data);
  const Endpoints endpoints = or_usage(endpoints_of(data.dir));
  auto bus = std::make_unique<Bus>(or_usage(KeyRing::open(endpoints.keys, "operator")));
  auto client = or_fail(Client::connect(*bus, "operator", unique_name("operator"), endpoints.dispatcher));
  return {std::move(bus), std::move(client)};
}

}  // namespace flamefield
