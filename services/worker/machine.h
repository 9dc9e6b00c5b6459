#pragma once

#include <cstdint>
#include <string>

namespace flamefield {

// What a worker tells the dispatcher of its machine, and what it learns about its own process.
std::string host_name();
std::int64_t memory_of_this_machine_mib();  // or what the control group allows, when that is less

// The most memory that this process held since the last reset (all of its threads; Linux 2.6.32 and later).
void reset_peak_memory();
double peak_memory_mib();

}  // namespace flamefield
