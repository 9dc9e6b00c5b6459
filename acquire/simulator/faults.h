#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string_view>
#include <vector>

#include "proto/error.h"

namespace flamefield {

// Pulses [first, end).
struct PulseRange {
  std::int64_t first = 0;
  std::int64_t end = 0;
  bool contains(std::int64_t pulse) const { return pulse >= first && pulse < end; }
};

// What goes wrong in one simulated camera, by pulse number, so that it goes wrong the same way every time.
struct CameraFaults {
  // At the trigger input.
  std::set<std::int64_t> missed_pulses = {};  // the edge is counted, but no picture is taken
  std::set<std::int64_t> unseen_pulses = {};  // loose contact: the edge is not even counted
  std::set<std::int64_t> extra_pulses = {};   // after this one a stray edge, counted, with a picture
  std::int64_t extra_delay_ns = 60'000'000;   // from the pulse to the stray edge

  // On the way to the client.
  double packet_loss = 0;                       // [0, 1] chance of each packet, resent ones included
  bool answers_resend = true;                   // false: lost packets stay lost
  std::set<std::int64_t> dropped_packets = {};  // every 16th packet is lost once; asking again brings it
  std::set<std::int64_t> lost_leaders = {};     // the leader never arrives, not even when asked for again
  std::set<std::int64_t> lost_trailers = {};    // the same with the trailer
  std::set<std::int64_t> lost_frames = {};      // mute: taken and numbered, but no packet of it arrives
  std::set<std::int64_t> reordered = {};        // packets arrive in another order
  std::set<std::int64_t> duplicated = {};       // every packet arrives twice
  std::set<std::int64_t> repeated = {};         // the whole frame is sent again, with the next frame id
  std::set<std::int64_t> corrupt = {};          // the leader names no known pixel format; noise goes out too
  std::map<std::int64_t, std::int64_t> delayed_ns = {};  // the frame leaves that much later

  // The camera as a whole.
  std::vector<PulseRange> power_cuts = {};  // dead: no answers, no pictures; afterwards default settings
  std::vector<PulseRange> link_cuts = {};   // nothing gets in or out, but the camera goes on
};

// Adds a fault written as KIND@PULSE, KIND@FIRST-LAST, or loss@SHARE, e.g. "missed@12", "dead@20-29",
// "loss@0.005". InvalidInput names the kinds.
Result<> add_fault(std::string_view text, CameraFaults& faults);

}  // namespace flamefield
