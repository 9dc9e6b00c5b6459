#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "proto/frame.h"

namespace flamefield {

struct HistoryLimits {
  std::int64_t pulses = 50;          // the last so many, [0, 100 000]
  std::int64_t bytes = 512ll << 20;  // of pixels; whichever is reached first
};

// The last pulses that standby saw, so that a burst can begin before someone asked for it. Not thread-safe.
class SetHistory {
 public:
  explicit SetHistory(const HistoryLimits& limits) : limits_(limits) {}

  // The oldest ones leave when a limit is reached.
  void push(FrameSet set);
  // The last ones, at most `pulses`, in the order of their pulses; the history is empty afterwards.
  std::vector<FrameSet> take_last(std::int64_t pulses);
  void clear();

  std::int64_t sets() const { return static_cast<std::int64_t>(sets_.size()); }
  std::int64_t bytes() const { return bytes_; }

 private:
  const HistoryLimits limits_;
  std::deque<FrameSet> sets_;
  std::int64_t bytes_ = 0;
};

}  // namespace flamefield
