#include "proto/capture.h"

namespace flamefield {

std::string_view name_of(CapturePhase phase) {
  switch (phase) {
    case CapturePhase::Idle:
      return "idle";
    case CapturePhase::Armed:
      return "armed";
    case CapturePhase::Draining:
      return "draining";
  }
  return "unknown";
}

}  // namespace flamefield
