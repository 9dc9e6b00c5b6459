#pragma once

#include <ctime>

namespace flamefield {

// Seconds since construction: of the clock on the wall, and of all cores that worked for this process.
class Stopwatch {
 public:
  double wall_s() const { return now_s(CLOCK_MONOTONIC) - wall_; }
  double cpu_s() const { return now_s(CLOCK_PROCESS_CPUTIME_ID) - cpu_; }

 private:
  static double now_s(clockid_t clock) {
    timespec now{};
    ::clock_gettime(clock, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
  }
  double wall_ = now_s(CLOCK_MONOTONIC), cpu_ = now_s(CLOCK_PROCESS_CPUTIME_ID);
};

}  // namespace flamefield
