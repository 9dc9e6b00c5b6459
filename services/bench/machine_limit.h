#pragma once

#include <string>

namespace flamefield {

// What one core of this machine can do, measured in a fraction of a second with the widest vectors it has.
struct MachineLimit {
  double fma_per_s = 0;            // fused multiply-adds of single floats, 16 chains in flight
  double cached_floats_per_s = 0;  // loaded from 256 KiB, the second-level cache
  double memory_floats_per_s = 0;  // loaded from 96 MiB, beyond the caches
  std::string vectors;             // name of the instruction set
};
MachineLimit measure_machine();

// The least a level projector can do for a sample of a ray: blend two voxel columns (two loads from the
// second-level cache, a multiplication and a multiply-add), interpolate between two heights (a subtraction
// and a multiply-add) and add to the pixel: five vector instructions, if nothing is reused. The volume and
// the images travel from memory once.
struct SampleLimit {
  double samples_per_cpu_s = 0;
  std::string bound_by;  // "cache", "arithmetic" or "memory"
};
SampleLimit sample_limit(const MachineLimit& machine, double samples, double floats_in_memory);

}  // namespace flamefield
