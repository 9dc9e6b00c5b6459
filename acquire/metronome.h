#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <thread>

namespace flamefield {

// Calls `beat` at an even rate, from a thread of its own. Beats keep to a schedule fixed at the start of a
// train, so a late wake-up never shifts the next one.
class Metronome {
 public:
  // index: in the train, from 0; due_ns: UTC. It must return at once.
  using Beat = std::function<void(std::int64_t index, std::int64_t due_ns)>;
  explicit Metronome(Beat beat);
  ~Metronome();
  Metronome(const Metronome&) = delete;
  Metronome& operator=(const Metronome&) = delete;

  // A train at rate_hz > 0, its first beat now; pulses = 0: until stop(). Replaces a running train.
  void start(double rate_hz, std::int64_t pulses);
  // No beat begins or goes on after it. Not to be called from a beat.
  void stop();
  bool is_running() const;
  // Until the train is over; false: not within the timeout.
  bool wait_idle(std::chrono::milliseconds timeout) const;

 private:
  void run();

  const Beat beat_;
  mutable std::mutex mutex_;  // what follows
  mutable std::condition_variable changed_;
  std::uint64_t train_ = 0;  // counts start() and stop()
  bool is_running_ = false;
  bool is_beating_ = false;
  bool quit_ = false;
  double period_s_ = 0;
  std::int64_t pulses_ = 0;
  std::thread thread_;
};

}  // namespace flamefield
