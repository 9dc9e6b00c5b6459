#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/image.h"
#include "reconstruct/area_map.h"

namespace flamefield {

// What one sensor's reference images say about a window of it: value = (grey - offset) * gain, then each hot
// pixel becomes the median of its sound neighbours.
class SensorCorrection {
 public:
  // References of whole sensors; null: none. A background contains the dark level. The flat field, less the
  // dark level, is divided by its mean over the window; where a twentieth or less of that is left, division
  // would only raise noise, and the value is 0. Hot: `hot_sigma` robust deviations off the neighbours, in the
  // dark image.
  SensorCorrection(const Window& window, const Image* dark, const Image* background, const Image* flat,
                   double hot_sigma);

  std::vector<float> apply(const Image& raw) const;  // (window.height, window.width)
  std::size_t hot_pixels() const { return hot_.size(); }
  // How many of these pixels, indices into the whole sensor's image, are in the window and not repaired.
  std::size_t count_used(std::span<const std::uint32_t> pixels, int sensor_width_px) const;

 private:
  struct HotPixel {
    std::uint32_t index = 0;
    std::vector<std::uint32_t> neighbours;  // sound ones among eight
  };
  void find_hot_pixels(const Image& dark, double hot_sigma);

  Window window_;
  std::vector<float> offset_, gain_;  // empty: 0, 1
  std::vector<HotPixel> hot_;         // by index
};

}  // namespace flamefield
