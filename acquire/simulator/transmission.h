#pragma once

#include <cstdint>
#include <vector>

#include "acquire/simulator/faults.h"
#include "acquire/simulator/gvsp.h"

namespace flamefield {

// Which packets of a frame the scripted faults let through. `attempt`: 0 when it is sent first, else a number
// of its own for each time that it is sent again; the same seed, frame, packet and attempt decide alike.
class Transmission {
 public:
  Transmission(const CameraFaults& faults, std::uint64_t seed) : faults_(faults), seed_(seed) {}

  bool is_lost(const StreamFrame& frame, std::uint32_t packet, std::uint64_t attempt) const;
  // The packets of a frame that leave, in the order in which they do, some of them twice.
  std::vector<std::uint32_t> sequence(const StreamFrame& frame) const;

 private:
  const CameraFaults& faults_;
  std::uint64_t seed_;
};

}  // namespace flamefield
