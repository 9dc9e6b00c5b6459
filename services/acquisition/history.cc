#include "services/acquisition/history.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace flamefield {

namespace {

std::int64_t bytes_of(const FrameSet& set) {
  std::int64_t bytes = 0;
  for (const Frame& frame : set.frames)
    bytes += frame.bytes ? static_cast<std::int64_t>(frame.bytes->size()) : 0;
  return bytes;
}

}  // namespace

void SetHistory::push(FrameSet set) {
  bytes_ += bytes_of(set);
  sets_.push_back(std::move(set));
  while (!sets_.empty() && (sets() > limits_.pulses || bytes_ > limits_.bytes)) {
    bytes_ -= bytes_of(sets_.front());
    sets_.pop_front();
  }
}

std::vector<FrameSet> SetHistory::take_last(std::int64_t pulses) {
  const auto taken = static_cast<std::ptrdiff_t>(std::clamp<std::int64_t>(pulses, 0, sets()));
  std::vector<FrameSet> out(std::make_move_iterator(sets_.end() - taken),
                            std::make_move_iterator(sets_.end()));
  clear();
  return out;
}

void SetHistory::clear() {
  sets_.clear();
  bytes_ = 0;
}

}  // namespace flamefield
