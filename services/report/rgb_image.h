#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "proto/error.h"
#include "proto/image.h"
#include "services/report/colour_map.h"

namespace flamefield {

// Eight bits a channel, row by row from the top left.
struct RgbImage {
  int width_px = 0;
  int height_px = 0;
  std::vector<std::uint8_t> bytes;  // (rows, cols, 3)

  RgbImage() = default;
  RgbImage(int width, int height)
      : width_px(width),
        height_px(height),
        bytes(3 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}
  std::uint8_t* at(int x, int y) {
    return bytes.data() + 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                               static_cast<std::size_t>(x));
  }
  const std::uint8_t* at(int x, int y) const {
    return bytes.data() + 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                               static_cast<std::size_t>(x));
  }
};

// Where the colour bar of an image begins and ends.
struct ValueRange {
  double low = 0;
  double high = 1;
};

// Zero to the largest finite value (1 when nothing is positive).
ValueRange emission_range(const std::vector<float>& values);

RgbImage coloured(const Image& image, const ColourMap& map, ValueRange range);

// Bicubic enlargement, or area averages when smaller; the picture is the same, only its pixels are not.
Image resized(const Image& image, int width_px, int height_px);

// PNG file contents, and back. InvalidInput for bytes that are no PNG.
std::string png_from(const RgbImage& image);
Result<RgbImage> rgb_from_png(const std::string& png);

// The file appears whole or not at all.
Result<> write_png(const std::filesystem::path& path, const RgbImage& image);

}  // namespace flamefield
