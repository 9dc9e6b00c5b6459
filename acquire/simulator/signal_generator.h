#pragma once

#include <cstdint>
#include <functional>
#include <mutex>

#include "acquire/metronome.h"
#include "acquire/simulator/scene.h"

namespace flamefield {

// The box that raises the trigger line. `on_edge` is called from the generator's thread (or fire()'s caller)
// and must return at once.
class SignalGenerator {
 public:
  explicit SignalGenerator(std::function<void(const Pulse&)> on_edge);
  SignalGenerator(const SignalGenerator&) = delete;
  SignalGenerator& operator=(const SignalGenerator&) = delete;

  // As Metronome.
  void start(double rate_hz, std::int64_t pulses) { metronome_.start(rate_hz, pulses); }
  void stop() { metronome_.stop(); }
  bool is_running() const { return metronome_.is_running(); }
  bool wait_idle(std::chrono::milliseconds timeout) const { return metronome_.wait_idle(timeout); }

  // One pulse now, by hand.
  Pulse fire();
  std::int64_t pulses() const;  // fired since the beginning

 private:
  Pulse raise(std::int64_t index, std::int64_t due_ns);

  const std::function<void(const Pulse&)> on_edge_;
  std::mutex edge_mutex_;  // edges reach the cameras one after the other
  mutable std::mutex mutex_;
  std::int64_t fired_ = 0;
  Metronome metronome_;  // the last: its thread uses the others
};

}  // namespace flamefield
