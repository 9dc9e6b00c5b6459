#include "services/api/frame_messages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "services/gateway/notice_board.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;
constexpr std::size_t kBins = 64;

// Grey levels, whatever the format; 16 bits hold them all.
std::vector<std::uint16_t> levels_of(const Frame& frame) {
  const auto image = grey_levels(frame);
  if (!image) return {};
  std::vector<std::uint16_t> levels(image->pixels.size());
  std::ranges::transform(image->pixels, levels.begin(),
                         [](float v) { return static_cast<std::uint16_t>(v); });
  return levels;
}

Json exposure_of(const std::vector<std::uint16_t>& levels, int bits) {
  const int full_scale = (1 << bits) - 1, shift = std::max(0, bits - 6);
  std::array<std::int64_t, kBins> histogram{};
  std::int64_t saturated = 0;
  double sum = 0;
  int brightest = 0;
  for (const std::uint16_t level : levels) {
    ++histogram[std::min<std::size_t>(level >> shift, kBins - 1)];
    saturated += level >= full_scale;
    sum += level;
    brightest = std::max<int>(brightest, level);
  }
  const double count = static_cast<double>(std::max<std::size_t>(levels.size(), 1));
  return {{"max", brightest},
          {"mean", std::round(100 * sum / count) / 100},
          {"saturated", saturated},
          {"histogram", histogram}};
}

Json head_of(const FrameSet& set) {
  return {{"capture", set.capture},
          {"kind", name_of(set.kind)},
          {"pulse", set.pulse},
          {"index", set.index},
          {"pulse_time_ns", set.pulse_time_ns},
          {"complete_time_ns", set.complete_time_ns}};
}

Json description_of(const Frame& frame, const std::vector<std::uint16_t>& levels) {
  const int bits = bits_of(frame.format);
  Json json = {{"name", frame.camera},
               {"pulse", frame.pulse},
               {"bits", bits},
               {"exposure_us", frame.exposure_us},
               {"full_width", frame.width_px},
               {"full_height", frame.height_px},
               {"arrival_time_ns", frame.arrival_time_ns}};
  json.update(exposure_of(levels, bits));
  return json;
}

// Means of `scale` x `scale` pixels, as 8 bits.
void shrink(const std::vector<std::uint16_t>& levels, int full_width, int width, int height, int scale,
            int bits, std::string& out) {
  const std::uint64_t area = static_cast<std::uint64_t>(scale) * static_cast<std::uint64_t>(scale);
  const int shift = std::max(0, bits - 8);
  std::vector<std::uint64_t> sums(static_cast<std::size_t>(width));
  for (int y = 0; y < height; ++y) {
    std::ranges::fill(sums, 0);
    for (int dy = 0; dy < scale; ++dy) {
      const std::uint16_t* row =
          levels.data() + static_cast<std::size_t>(y * scale + dy) * static_cast<std::size_t>(full_width);
      for (int x = 0; x < width; ++x) {
        for (int dx = 0; dx < scale; ++dx) sums[static_cast<std::size_t>(x)] += row[x * scale + dx];
      }
    }
    for (const std::uint64_t sum : sums) out += static_cast<char>(sum / area >> shift);
  }
}

}  // namespace

std::string thumbnails_message(const FrameSet& set, int most_px) {
  Json head = head_of(set), cameras = Json::array(), losses = Json::array();
  std::string payload;
  for (const Frame& frame : set.frames) {
    const std::vector<std::uint16_t> levels = levels_of(frame);
    if (levels.empty()) continue;
    const int scale = std::max(1, (frame.width_px + most_px - 1) / most_px);
    Json camera = description_of(frame, levels);
    const int width = frame.width_px / scale, height = frame.height_px / scale;
    camera.update(Json{{"width", width}, {"height", height}, {"scale", scale}, {"offset", payload.size()}});
    shrink(levels, frame.width_px, width, height, scale, bits_of(frame.format), payload);
    cameras.push_back(std::move(camera));
  }
  for (const FrameLoss& loss : set.losses)
    losses.push_back({{"camera", loss.camera}, {"cause", name_of(loss.cause)}});
  head["topic"] = "thumbnails";
  head["losses"] = std::move(losses);
  head["cameras"] = std::move(cameras);
  return framed(head.dump(), payload);
}

Result<std::string> frame_message(const FrameSet& set, const Frame& frame) {
  const std::vector<std::uint16_t> levels = levels_of(frame);
  if (levels.empty()) {
    return invalid_input("frame of " + frame.camera, "its bytes do not match its size", "record it again");
  }
  Json head = head_of(set);
  head["topic"] = "frame:" + frame.camera;
  head["camera"] = description_of(frame, levels);
  std::string payload;
  const bool is_wide = bits_of(frame.format) > 8;
  payload.reserve(levels.size() * (is_wide ? 2 : 1));
  for (const std::uint16_t level : levels) {
    payload += static_cast<char>(level & 0xff);
    if (is_wide) payload += static_cast<char>(level >> 8);
  }
  return framed(head.dump(), payload);
}

}  // namespace flamefield
