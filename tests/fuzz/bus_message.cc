#include <cstdlib>

#include "proto/codec.h"
#include "tests/fuzz/targets.h"

namespace flamefield::fuzz {

void bus_message(Bytes bytes) {
  const auto decoded = decode(std::as_bytes(bytes));
  if (!decoded) return;
  if (const FrameSet* set = frame_set_of(decoded->message)) {
    // Pixels of the right sizes are taken, one byte less is not.
    FrameSet good = *set, bad = *set;
    std::vector<flamefield::Bytes> parts;
    std::size_t sum = 0;
    for (const Frame& frame : set->frames) {
      const std::size_t n = bytes_of_image(frame.format, frame.width_px, frame.height_px);
      if ((sum += n) > 1u << 20) return;
      parts.push_back(std::make_shared<const std::vector<std::byte>>(n));
    }
    if (!attach_frames(good, parts)) std::abort();
    if (parts.empty()) return;
    parts.back() = std::make_shared<const std::vector<std::byte>>(parts.back()->size() - 1);
    if (attach_frames(bad, parts)) std::abort();
    return;
  }
  const std::string again = encode(decoded->message, decoded->request);
  const auto twice = decode(std::as_bytes(std::span(again)));
  if (!twice || encode(twice->message, twice->request) != again) std::abort();
}

}  // namespace flamefield::fuzz
