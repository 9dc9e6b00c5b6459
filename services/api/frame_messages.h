#pragma once

#include <string>

#include "proto/frame.h"

namespace flamefield {

// Binary messages for pages (services/gateway/notice_board.h says how they are framed).

// Every camera of a set, small: 8 bits a pixel, at most `most_px` wide. Header: topic "thumbnails", capture,
// kind, pulse, index, pulse_time_ns, complete_time_ns, losses[{camera cause}], cameras[{name pulse width
// height scale full_width full_height bits offset exposure_us max mean saturated histogram[64]}]; `scale`
// full pixels make one, `offset` is where the camera's pixels begin in the payload, `saturated` counts full
// pixels at full scale.
std::string thumbnails_message(const FrameSet& set, int most_px);

// One frame with every pixel: uint8, or uint16 (little-endian) for more than 8 bits. Header: topic
// "frame:CAMERA", and as above. InvalidInput when the bytes do not match the size.
Result<std::string> frame_message(const FrameSet& set, const Frame& frame);

}  // namespace flamefield
