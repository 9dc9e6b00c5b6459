#pragma once

#include "proto/frame.h"
#include "proto/job.h"
#include "reconstruct/projector.h"

namespace flamefield {

// A flame small enough to be reconstructed in milliseconds, and what five cameras around it saw.
struct Miniature {
  static constexpr double kCountsPerUnit = 10;
  static constexpr int kDark = 12;  // grey level

  Volume truth;
  Rig rig;
  Projections views;

  Miniature();

  // 8-bit frames of the flame (or of the closed shutter), a little brighter from set to set.
  FrameSet set(const std::string& capture, CaptureKind kind, std::int64_t index) const;

  // mlem with so many iterations; expects a capture "dark".
  Processing processing(int iterations) const;
};

}  // namespace flamefield
