#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "acquire/settings.h"
#include "proto/error.h"

namespace flamefield {

// What a GigE Vision device says of itself.
struct DiscoveredCamera {
  std::string address, mac, vendor, model, serial, user_name;
};

// Asks one address, and no other, whether a GigE Vision device is there: a DISCOVERY command, sent up to
// three times within the timeout.
std::optional<DiscoveredCamera> discover_at(const std::string& address, std::chrono::milliseconds timeout);
bool answers_discovery(const std::string& address, std::chrono::milliseconds timeout);

// All devices that answer a broadcast on any network interface within the time. Two with one address and
// different hardware addresses are an address used twice.
std::vector<DiscoveredCamera> discover_all(std::chrono::milliseconds wait);

// Unavailable: two of these devices use one address; the error names both by serial number and hardware
// address.
Result<> check_addresses_differ(const std::vector<DiscoveredCamera>& found);

// Gives cameras that are known by serial number or user-defined name only the address where they are now.
// NotFound names those that do not answer. Unavailable: two devices use one address. Listens for that too
// when all addresses are known, unless they are of this machine.
Result<std::vector<CameraAddress>> resolve_addresses(std::vector<CameraAddress> cameras);

// One bootstrap register of a device, without having control of it; none: no answer.
std::optional<std::uint32_t> read_bootstrap_register(const std::string& address, std::uint32_t reg,
                                                     std::chrono::milliseconds timeout);

// Decodes a DISCOVERY acknowledge; none when it is too short or something else.
std::optional<DiscoveredCamera> decode_discovery(const std::uint8_t* bytes, std::size_t size);

}  // namespace flamefield
