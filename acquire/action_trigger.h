#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "acquire/metronome.h"
#include "acquire/settings.h"
#include "proto/error.h"

namespace flamefield {

// The clock of a camera that keeps the network's time (IEEE 1588, PTP).
struct SharedClock {
  std::int64_t ahead_ns = 0;  // of this machine's UTC
  std::int64_t error_ns = 0;  // at most
  double ticks_per_s = 0;
};

// The clock that all of these show; none: they differ by more than reading them can explain.
std::optional<SharedClock> agreed_clock(std::vector<SharedClock> clocks);

// An ACTION command as it goes on the wire (GigE Vision 2.0, section 14.3); with a time in ticks: scheduled.
std::vector<std::uint8_t> encode_action(const ActionKeys& keys, std::uint16_t request_id,
                                        std::optional<std::uint64_t> ticks);

// A signal generator without a wire: fires cameras by action commands over the network. Cameras that share a
// clock fire at one moment, some time ahead; others when their packet comes, in an order of tens of
// microseconds.
class ActionTrigger {
 public:
  // InvalidInput: an address is none. Unavailable: no socket.
  static Result<std::unique_ptr<ActionTrigger>> open(const std::vector<std::string>& addresses,
                                                     const ActionKeys& keys);
  ~ActionTrigger();
  ActionTrigger(const ActionTrigger&) = delete;
  ActionTrigger& operator=(const ActionTrigger&) = delete;

  // From the next train on; none: cameras fire when they hear of it.
  void schedule_with(std::optional<SharedClock> clock);
  // As Metronome.
  void start(double rate_hz, std::int64_t pulses) { metronome_.start(rate_hz, pulses); }
  void stop() { metronome_.stop(); }
  std::int64_t fired() const;

 private:
  ActionTrigger();
  void fire(std::int64_t due_utc_ns);

  ActionKeys keys_;
  std::vector<std::uint32_t> to_;  // IPv4, network byte order
  int socket_ = -1;

  mutable std::mutex mutex_;  // what follows
  std::optional<SharedClock> clock_;
  std::int64_t fired_ = 0;
  std::uint16_t request_id_ = 0;

  Metronome metronome_;  // the last: its thread uses the others
};

}  // namespace flamefield
