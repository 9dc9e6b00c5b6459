#pragma once

#include <map>
#include <string>

#include "proto/version.h"

namespace flamefield {

// Where data come from: solver, recipe and rig fingerprints, program version... Kept inside the file.
using Provenance = std::map<std::string, std::string>;

}  // namespace flamefield
