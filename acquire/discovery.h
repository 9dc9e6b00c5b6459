#pragma once

#include <chrono>
#include <string>

namespace flamefield {

// Asks one address, and no other, whether a GigE Vision device is there: a DISCOVERY command, sent up to
// three times within the timeout.
bool answers_discovery(const std::string& address, std::chrono::milliseconds timeout);

}  // namespace flamefield
