#pragma once

#include <cstdint>
#include <optional>
#include <set>

namespace flamefield {

// What goes wrong in one simulated camera, by pulse number, so that it goes wrong the same way every time.
struct CameraFaults {
  std::set<std::int64_t> missed_pulses = {};  // the edge is counted, but no picture is taken
  std::set<std::int64_t> lost_leaders = {};   // the leader never arrives, not even when asked for again
  std::set<std::int64_t> lost_frames = {};    // taken and numbered, but no packet of it arrives
  double packet_loss = 0;                     // [0, 1] chance of each packet, resent ones included
  bool answers_resend = true;                 // false: lost packets stay lost
  std::optional<std::int64_t> dies_at_pulse =
      std::nullopt;  // power cut: no answers, no pictures from this pulse on
  std::optional<std::int64_t> revives_at_pulse =
      std::nullopt;  // power is back before this pulse, with default settings
};

}  // namespace flamefield
