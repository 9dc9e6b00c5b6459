#include "proto/calibration.h"

namespace flamefield {

std::string_view name_of(CalibrationPhase phase) {
  switch (phase) {
    case CalibrationPhase::Idle:
      return "idle";
    case CalibrationPhase::Detecting:
      return "detecting";
    case CalibrationPhase::Solving:
      return "solving";
    case CalibrationPhase::Solved:
      return "solved";
  }
  return "unknown";
}

}  // namespace flamefield
