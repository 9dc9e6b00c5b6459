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
  std::string role = "operator";  // on the bus
  std::string acquisition, dispatcher;
  std::filesystem::path data_dir;
  std::string calibration = {};  // empty: nobody holds calibration sessions here
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
  // Unavailable at once where nobody holds sessions.
  template <class Answer>
  Result<Answer> ask_calibration(const Message& question, std::chrono::milliseconds patience = kPatience) {
    if (!has_calibration()) {
      return unavailable(
          "calibration session", "no service holds sessions for this installation",
          "start 'flamefield serve', or solve recorded pictures with 'flamefield calibrate solve'");
    }
    return ask<Answer>(at_.calibration, question, patience);
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
  // Sockets in the file system are there as long as their service is, or was killed.
  bool has_calibration() const {
    constexpr std::string_view kLocal = "ipc://";
    if (!at_.calibration.starts_with(kLocal)) return !at_.calibration.empty();
    std::error_code ignored;
    return std::filesystem::exists(at_.calibration.substr(kLocal.size()), ignored);
  }

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
