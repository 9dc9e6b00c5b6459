#pragma once

#include <filesystem>
#include <string>

#include "services/bus/bus.h"
#include "services/gateway/gateway.h"

namespace flamefield {

// What the live page shows, asked of the services over the bus and read from the ledger, request by request:
// the gateway may sit in their process or in one of its own.
GatewaySources gateway_sources(Bus& bus, const std::string& role, const std::string& acquisition_endpoint,
                               const std::string& dispatcher_endpoint, const std::filesystem::path& data_dir,
                               const std::filesystem::path& report);

}  // namespace flamefield
