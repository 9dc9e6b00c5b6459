#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

#include "services/bus/client.h"
#include "services/ledger/reader.h"

namespace flamefield {

// Where an installation is reached.
struct ServiceAddresses {
  std::string role = "client";  // on the bus
  std::string acquisition, dispatcher;
  std::filesystem::path data_dir;
};

// Questions to the services and looks into the ledger. Any thread; each call has a connection of its own.
class LiveServices {
 public:
  LiveServices(Bus& bus, ServiceAddresses addresses) : bus_(bus), at_(std::move(addresses)) {}

  template <class Answer>
  Result<Answer> ask_array(const Message& question, std::chrono::milliseconds patience = kPatience) {
    return ask<Answer>(at_.acquisition, question, patience);
  }
  template <class Answer>
  Result<Answer> ask_dispatcher(const Message& question, std::chrono::milliseconds patience = kPatience) {
    return ask<Answer>(at_.dispatcher, question, patience);
  }
  Result<Client> connect_array() {
    return Client::connect(bus_, at_.role, unique_name("gateway"), at_.acquisition);
  }
  Result<Client> connect_dispatcher() {
    return Client::connect(bus_, at_.role, unique_name("gateway"), at_.dispatcher);
  }
  Result<LedgerReader> ledger() const { return LedgerReader::open(at_.data_dir); }
  const std::filesystem::path& data_dir() const { return at_.data_dir; }

  static constexpr std::chrono::milliseconds kPatience{3000};

 private:
  template <class Answer>
  Result<Answer> ask(const std::string& endpoint, const Message& question,
                     std::chrono::milliseconds patience) {
    auto client = Client::connect(bus_, at_.role, unique_name("gateway"), endpoint);
    if (!client) return tl::unexpected(client.error());
    return client->ask_for<Answer>(question, patience);
  }

  Bus& bus_;
  const ServiceAddresses at_;
};

}  // namespace flamefield
