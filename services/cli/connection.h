#pragma once

#include <filesystem>
#include <memory>

#include "services/acquisition/operator.h"
#include "services/bus/bus.h"
#include "services/serve/endpoints.h"

namespace CLI {
class App;
}

namespace flamefield {

// --data: the folder of the services that a command talks to.
struct DataOption {
  std::filesystem::path dir = "flamefield-data";
};
void add_data(CLI::App& command, DataOption& data);

// A running `flamefield serve`, reached through the sockets and keys of its data folder.
struct Connection {
  std::unique_ptr<Bus> bus;
  Operator operating;
  Endpoints endpoints;
};
// Ends the command when there is no such folder or nobody serves it.
Connection connect_to(const DataOption& data);

// The same where only the dispatcher is needed.
struct DispatcherConnection {
  std::unique_ptr<Bus> bus;
  Client client;
};
DispatcherConnection connect_to_dispatcher(const DataOption& data);

}  // namespace flamefield
