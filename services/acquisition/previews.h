#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "proto/frame.h"

namespace flamefield {

// How far previews step back while sets wait to be stored.
struct PreviewPolicy {
  std::int64_t most_waiting_sets = 200;  // then the capture ends
  // Every how many pulses a preview may show: 1 while storing keeps up, then 5, then 25; 0: none any more.
  std::int64_t stride(std::int64_t waiting_sets) const;
};

// The newest picture of every camera. Looking costs bus and processor, so that when the disk falls behind it
// is looking that suffers first, never recording; every frame that was not shown is counted. Not thread-safe.
class Previews {
 public:
  explicit Previews(const PreviewPolicy& policy) : policy_(policy) {}

  void update(const FrameSet& set, std::int64_t waiting_sets);
  const Frame* newest(const std::string& camera) const;
  bool has_any() const { return !newest_.empty(); }
  FrameSet newest_set() const;  // with the newest frame of every camera, be it of an earlier set
  bool is_paused() const { return stride_ == 0; }
  std::int64_t skipped() const { return skipped_; }
  void count_from_zero() { skipped_ = 0; }

 private:
  const PreviewPolicy policy_;
  std::map<std::string, Frame> newest_;
  FrameSet newest_set_;  // without its frames
  std::int64_t stride_ = 1;
  std::int64_t sets_since_ = 0;  // that were not shown
  std::int64_t skipped_ = 0;
};

}  // namespace flamefield
