#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace flamefield {

// One grey image, row by row from the top left.
struct Image {
  int width_px = 0;
  int height_px = 0;
  std::vector<float> pixels;  // (rows, cols)

  Image() = default;
  Image(int width, int height, float value = 0)
      : width_px(width),
        height_px(height),
        pixels(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), value) {}
  float& at(int x, int y) {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                  static_cast<std::size_t>(x)];
  }
  float at(int x, int y) const {
    return pixels[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                  static_cast<std::size_t>(x)];
  }
};

// Line-of-sight integrals of all views, (field unit x mm). Views of one size, in the rig's order.
struct Projections {
  std::vector<std::string> view_names;  // camera names
  int rows = 0;
  int cols = 0;
  std::vector<float> values;  // (views, rows, cols)

  std::size_t views() const { return view_names.size(); }
  std::size_t pixels_per_view() const {
    return static_cast<std::size_t>(rows) * static_cast<std::size_t>(cols);
  }
  std::span<float> view(std::size_t i) {
    return std::span(values).subspan(i * pixels_per_view(), pixels_per_view());
  }
  std::span<const float> view(std::size_t i) const {
    return std::span(values).subspan(i * pixels_per_view(), pixels_per_view());
  }
};

}  // namespace flamefield
