#pragma once

#include <string_view>

namespace flamefield {

// deploy/slurm/pilot.sh
std::string_view pilot_script();

}  // namespace flamefield
