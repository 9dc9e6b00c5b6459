#pragma once

#include <cstdint>
#include <optional>

#include "proto/frame.h"

namespace flamefield {

// A frame as one camera delivered it, before anyone knows which pulse it belongs to (frame.pulse is 0).
struct Arrival {
  Frame frame;
  std::optional<std::int64_t> trigger_count;  // edges that the camera had counted; none: it does not count
  std::int64_t exposure_utc_ns = 0;           // start of the exposure, by the camera's clock put on UTC
  std::int64_t clock_error_ns = 0;            // at most, when that clock was put on UTC
};

}  // namespace flamefield
