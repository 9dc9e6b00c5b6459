#pragma once

#include <cstdint>
#include <functional>

#include "proto/frame.h"

namespace flamefield {

// What happens around a capture outside the cameras; each may be empty. A laboratory with a gated signal
// generator starts it when the cameras are armed, so that the first pulse of a capture is its number 1.
struct CaptureHooks {
  std::function<void(CaptureKind)> before;                      // cameras not yet armed
  std::function<void(CaptureKind, std::int64_t pulses)> armed;  // pulses 0: until finished
  std::function<void()> finished;                               // no more pulses are wanted
};

}  // namespace flamefield
