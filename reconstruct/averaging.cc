#include "reconstruct/averaging.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

namespace {

float full_scale(PixelFormat format) {
  return static_cast<float>((1 << bits_of(format)) - 1);
}

void mark_saturated(const Image& image, float limit, std::vector<std::uint32_t>& out) {
  unsigned count = 0;  // most images have none, and counting is many pixels at a time
  for (float p : image.pixels) count += p >= limit ? 1 : 0;
  if (count == 0) return;
  for (std::size_t i = 0; i < image.pixels.size(); ++i)
    if (image.pixels[i] >= limit) out.push_back(static_cast<std::uint32_t>(i));
}

// Sums in double, but only once there is a second frame: live sets have one.
struct Sum {
  std::vector<double> values;
  int count = 0;
};

void add(Sum& sum, Image& mean, Image&& image) {
  if (++sum.count == 1) {
    mean = std::move(image);
    return;
  }
  if (sum.count == 2) sum.values.assign(mean.pixels.begin(), mean.pixels.end());
  for (std::size_t i = 0; i < sum.values.size(); ++i) sum.values[i] += image.pixels[i];
}

}  // namespace

Result<MeanImages> mean_images(const std::vector<FrameSet>& sets) {
  MeanImages out;
  out.sets = sets.size();
  std::map<std::string, Sum> sums;
  for (const FrameSet& set : sets)
    for (const Frame& frame : set.frames) {
      auto image = grey_levels(frame);
      if (!image) return tl::unexpected(image.error());
      out.full_scale = std::max(out.full_scale, static_cast<double>(full_scale(frame.format)));
      Sum& sum = sums[frame.camera];
      Image& mean = out.images[frame.camera];
      if (sum.count > 0 && (image->width_px != mean.width_px || image->height_px != mean.height_px)) {
        return invalid_input(concat("camera ", frame.camera, ", pulse ", frame.pulse, ": ", image->width_px,
                                    "x", image->height_px, " px"),
                             concat("earlier frames had ", mean.width_px, "x", mean.height_px),
                             "average one capture at a time");
      }
      mark_saturated(*image, full_scale(frame.format), out.saturated[frame.camera]);
      add(sum, mean, std::move(*image));
    }
  for (auto& [camera, image] : out.images) {
    const Sum& sum = sums[camera];
    for (std::size_t i = 0; i < sum.values.size(); ++i)
      image.pixels[i] = static_cast<float>(sum.values[i] / sum.count);
    auto& saturated = out.saturated[camera];
    std::ranges::sort(saturated);
    saturated.erase(std::unique(saturated.begin(), saturated.end()), saturated.end());
  }
  return out;
}

Result<std::vector<FrameSet>> phase_locked(const std::vector<FrameSet>& sets, const PhaseLock& lock) {
  if (lock.every < 1 || lock.first < 0 || lock.first >= lock.every) {
    return invalid_input(concat("first pulse ", lock.first, " of every ", lock.every),
                         "it must be 0 or more and less than the step",
                         "set prepare.first and prepare.every");
  }
  if (lock.frequency_hz > 0 && (lock.bins < 1 || lock.bin < 0 || lock.bin >= lock.bins)) {
    return invalid_input(concat("phase ", lock.bin, " of ", lock.bins),
                         "phases are counted from 0 and less than their number",
                         "set prepare.phase_bin and prepare.phase_bins");
  }
  if (sets.empty() || !lock.is_on()) return sets;
  const auto first = std::ranges::min_element(sets, {}, &FrameSet::pulse);
  const auto last = std::ranges::max_element(sets, {}, &FrameSet::pulse);
  if (lock.frequency_hz > 0 && sets.size() > 1 && first->pulse_time_ns == last->pulse_time_ns) {
    return invalid_input("frame sets without pulse times", "their phase is unknown",
                         "take every k-th pulse instead (prepare.every)");
  }
  std::vector<FrameSet> out;
  for (const FrameSet& set : sets) {
    if ((set.pulse - first->pulse) % lock.every != lock.first) continue;
    if (lock.frequency_hz > 0) {
      const double turns =
          1e-9 * static_cast<double>(set.pulse_time_ns - first->pulse_time_ns) * lock.frequency_hz;
      // Bins are centred on their phase, so that a jitter of the trigger does not split one.
      const double bin = std::floor((turns - std::floor(turns)) * lock.bins + 0.5);
      if (static_cast<int>(bin) % lock.bins != lock.bin) continue;
    }
    out.push_back(set);
  }
  if (out.empty()) {
    return invalid_input(concat("none of ", sets.size(), " frame sets has the phase asked for"),
                         "there is nothing to average", "record more pulses or use fewer phases");
  }
  return out;
}

}  // namespace flamefield
