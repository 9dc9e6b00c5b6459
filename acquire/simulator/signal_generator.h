#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>

#include "acquire/simulator/scene.h"

namespace flamefield {

// The box that raises the trigger line. Pulses keep to a schedule fixed at the start of a train, so a late
// wake-up never shifts the next pulse. `on_edge` is called from the generator's thread (or fire()'s caller)
// and must return at once.
class SignalGenerator {
 public:
  explicit SignalGenerator(std::function<void(const Pulse&)> on_edge);
  ~SignalGenerator();
  SignalGenerator(const SignalGenerator&) = delete;
  SignalGenerator& operator=(const SignalGenerator&) = delete;

  // A train of pulses at rate_hz > 0, the first one now; pulses = 0: until stop(). Replaces a running train.
  void start(double rate_hz, std::int64_t pulses);
  void stop();
  // One pulse now, by hand.
  Pulse fire();

  bool is_running() const;
  std::int64_t pulses() const;  // fired since the beginning
  // Until the train is over; false: not within the timeout.
  bool wait_idle(std::chrono::milliseconds timeout) const;

 private:
  void run();
  Pulse raise(std::unique_lock<std::mutex>& lock, std::int64_t index, std::int64_t due_ns);

  const std::function<void(const Pulse&)> on_edge_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  std::mutex edge_mutex_;  // edges reach the cameras one after the other
  std::int64_t fired_ = 0;
  std::uint64_t train_ = 0;  // counts start() and stop()
  bool is_running_ = false;
  double period_s_ = 0;
  std::int64_t pulses_ = 0;
  bool quit_ = false;
  std::thread thread_;
};

}  // namespace flamefield
