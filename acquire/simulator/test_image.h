#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "acquire/simulator/scene.h"
#include "acquire/simulator/sensor.h"
#include "proto/frame.h"

namespace flamefield {

// The camera's test image instead of the sensor's: a diagonal ramp whose first pixels carry a stamp, so that
// whoever receives it can tell which camera took it at which pulse, without trusting any counter or clock.
struct ImageStamp {
  std::size_t camera = 0;  // number in the array
  std::int64_t pulse = 0;
  bool is_stray = false;
  bool operator==(const ImageStamp&) const = default;
};

class TestImage {
 public:
  // The bytes on the wire. Remembers the ramp of the last size and format; one thread.
  std::vector<std::uint8_t> expose(const Sensor::Readout& readout, const ImageStamp& stamp);

 private:
  Sensor::Readout readout_;
  std::vector<std::uint8_t> ramp_;
};

// None unless all of the picture, pixel by pixel, is a stamped test image.
std::optional<ImageStamp> read_test_image(const Frame& frame);

}  // namespace flamefield
