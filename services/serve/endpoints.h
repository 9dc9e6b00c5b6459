#pragma once

#include <filesystem>
#include <string>

#include "services/bus/keys.h"

namespace flamefield {

// Where the services of one data directory are found by other processes of this machine: sockets under
// <data>/run, keys under <data>/keys. Whoever may read the keys may talk to them.
struct Endpoints {
  std::string dispatcher;
  std::string events;
  std::string acquisition;
  std::string calibration;
  std::filesystem::path keys;
};

// Makes <data>/run. InvalidInput: the path is too long for a socket (107 characters), or cannot be made.
Result<Endpoints> endpoints_of(const std::filesystem::path& data_dir);

}  // namespace flamefield
