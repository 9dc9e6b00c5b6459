#include "services/acquisition/previews.h"

namespace flamefield {

std::int64_t PreviewPolicy::stride(std::int64_t waiting_sets) const {
  if (2 * waiting_sets > most_waiting_sets) return 0;
  if (8 * waiting_sets > most_waiting_sets) return 25;
  return 32 * waiting_sets > most_waiting_sets ? 5 : 1;
}

void Previews::update(const FrameSet& set, std::int64_t waiting_sets) {
  stride_ = policy_.stride(waiting_sets);
  if (stride_ == 0 || ++sets_since_ < stride_) {
    skipped_ += static_cast<std::int64_t>(set.frames.size());
    return;
  }
  sets_since_ = 0;
  for (const Frame& frame : set.frames) newest_[frame.camera] = frame;
  newest_set_ = set;
  newest_set_.frames.clear();
}

FrameSet Previews::newest_set() const {
  FrameSet set = newest_set_;
  for (const auto& [camera, frame] : newest_) set.frames.push_back(frame);
  return set;
}

const Frame* Previews::newest(const std::string& camera) const {
  const auto found = newest_.find(camera);
  return found == newest_.end() ? nullptr : &found->second;
}

}  // namespace flamefield
