#include "acquire/simulator/signal_generator.h"

#include "proto/utc.h"

namespace flamefield {

SignalGenerator::SignalGenerator(std::function<void(const Pulse&)> on_edge)
    : on_edge_(std::move(on_edge)),
      metronome_([this](std::int64_t index, std::int64_t due_ns) { raise(index, due_ns); }) {}

Pulse SignalGenerator::fire() {
  return raise(0, utc_now_ns());
}

std::int64_t SignalGenerator::pulses() const {
  const std::lock_guard lock(mutex_);
  return fired_;
}

// Numbers the pulse under the lock; the cameras hear of it outside, so that they may ask back.
Pulse SignalGenerator::raise(std::int64_t index, std::int64_t due_ns) {
  const std::lock_guard in_order(edge_mutex_);
  Pulse pulse{.index = index, .time_ns = due_ns};
  {
    const std::lock_guard lock(mutex_);
    pulse.number = ++fired_;
  }
  on_edge_(pulse);
  return pulse;
}

}  // namespace flamefield
