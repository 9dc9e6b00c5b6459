#pragma once

#include <string_view>

namespace flamefield {

// The program's version, e.g. "0.1.0": part of the identity of every run.
std::string_view program_version();

}  // namespace flamefield
