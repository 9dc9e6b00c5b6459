#pragma once

#include <map>
#include <string>
#include <string_view>

namespace flamefield {

// Where data come from: solver, recipe and rig fingerprints, program version... Kept inside the file.
using Provenance = std::map<std::string, std::string>;

// e.g. "0.1.0"
std::string_view program_version();

}  // namespace flamefield
