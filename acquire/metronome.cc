#include "acquire/metronome.h"

#include "proto/check.h"
#include "proto/utc.h"

namespace flamefield {

using Clock = std::chrono::steady_clock;

Metronome::Metronome(Beat beat) : beat_(std::move(beat)), thread_([this] { run(); }) {}

Metronome::~Metronome() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
    ++train_;
  }
  changed_.notify_all();
  thread_.join();
}

void Metronome::start(double rate_hz, std::int64_t pulses) {
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

void Metronome::stop() {
  std::unique_lock lock(mutex_);
  ++train_;
  is_running_ = false;
  changed_.notify_all();
  changed_.wait(lock, [this] { return !is_beating_; });
}

bool Metronome::is_running() const {
  const std::lock_guard lock(mutex_);
  return is_running_;
}

bool Metronome::wait_idle(std::chrono::milliseconds timeout) const {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, timeout, [this] { return !is_running_; });
}

void Metronome::run() {
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
      is_beating_ = true;
      lock.unlock();
      // The time is when the beat was due: signal generators are not late, threads are.
      beat_(index, begin_utc_ns + std::chrono::duration_cast<std::chrono::nanoseconds>(due).count());
      lock.lock();
      is_beating_ = false;
      changed_.notify_all();
      if (is_over()) break;
    }
    if (!is_over()) {
      is_running_ = false;
      changed_.notify_all();
    }
  }
}

}  // namespace flamefield
