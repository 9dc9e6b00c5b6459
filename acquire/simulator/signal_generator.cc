#include "acquire/simulator/signal_generator.h"

#include <chrono>

#include "proto/check.h"
#include "proto/utc.h"

namespace flamefield {

using Clock = std::chrono::steady_clock;

SignalGenerator::SignalGenerator(std::function<void(const Pulse&)> on_edge)
    : on_edge_(std::move(on_edge)), thread_([this] { run(); }) {}

SignalGenerator::~SignalGenerator() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    ++train_;
  }
  changed_.notify_all();
  thread_.join();
}

void SignalGenerator::start(double rate_hz, std::int64_t pulses) {
  expect(rate_hz > 0 && pulses >= 0, "a train has a positive rate and no negative length");
  {
    const std::lock_guard lock(mutex_);
    ++train_;
    is_running_ = true;
    period_s_ = 1 / rate_hz;
    pulses_ = pulses;
  }
  changed_.notify_all();
}

void SignalGenerator::stop() {
  {
    const std::lock_guard lock(mutex_);
    ++train_;
    is_running_ = false;
  }
  changed_.notify_all();
}

Pulse SignalGenerator::fire() {
  std::unique_lock lock(mutex_);
  return raise(lock, 0, utc_now_ns());
}

// Numbers the pulse under the lock; the cameras hear of it outside, so that they may ask back.
Pulse SignalGenerator::raise(std::unique_lock<std::mutex>& lock, std::int64_t index, std::int64_t due_ns) {
  lock.unlock();
  const std::lock_guard in_order(edge_mutex_);
  lock.lock();
  const Pulse pulse{.number = ++fired_, .index = index, .time_ns = due_ns};
  lock.unlock();
  on_edge_(pulse);
  lock.lock();
  return pulse;
}

bool SignalGenerator::is_running() const {
  const std::lock_guard lock(mutex_);
  return is_running_;
}

std::int64_t SignalGenerator::pulses() const {
  const std::lock_guard lock(mutex_);
  return fired_;
}

bool SignalGenerator::wait_idle(std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] { return !is_running_; });
}

void SignalGenerator::run() {
  std::unique_lock lock(mutex_);
  while (!quit_) {
    changed_.wait(lock, [this] { return quit_ || is_running_; });
    if (quit_) return;
    const std::uint64_t train = train_;
    const auto is_over = [&] { return train != train_; };
    const Clock::time_point begin = Clock::now();
    const std::int64_t begin_utc_ns = utc_now_ns();
    for (std::int64_t index = 0; pulses_ == 0 || index < pulses_; ++index) {
      const std::chrono::duration<double> due(period_s_ * static_cast<double>(index));
      if (changed_.wait_until(lock, begin + std::chrono::duration_cast<Clock::duration>(due), is_over)) break;
      // The time is when the edge was due: signal generators are not late, threads are.
      raise(lock, index, begin_utc_ns + std::chrono::duration_cast<std::chrono::nanoseconds>(due).count());
      if (is_over()) break;
    }
    if (!is_over()) {
      is_running_ = false;
      changed_.notify_all();
    }
  }
}

}  // namespace flamefield
