#pragma once

#include <string>

#include "proto/error.h"

namespace flamefield {

// The page knows no passwords and no TLS, so it listens to this machine only: 127.0.0.0/8 or ::1.
// InvalidInput otherwise, with the way to show it to others.
Result<> check_exposure(const std::string& address);

}  // namespace flamefield
