#include "reconstruct/variational/noise_level.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace flamefield {

namespace {

constexpr std::size_t kClasses = 8;
constexpr std::size_t kEnough = 200000;  // samples; of larger images every so many-th pixel is looked at

struct Sample {
  float brightness;  // sum over 3 x 3 pixels
  float detail;      // |second difference along both axes|
  auto operator<=>(const Sample&) const = default;
};

std::vector<Sample> samples_of(std::span<const float> images, const Layout& l) {
  const auto cols = static_cast<std::size_t>(std::max(l.cols - 2, 0)),
             rows = static_cast<std::size_t>(std::max(l.rows - 2, 0)),
             views = static_cast<std::size_t>(l.views);
  const std::size_t stride = cols * rows * views / kEnough + 1;
  std::vector<Sample> out;
  for (std::size_t i = 0; i < cols * rows * views; i += stride) {
    const std::size_t row = i % rows, col = i / rows % cols, view = i / rows / cols;
    const float* at = images.data() + view * l.pixels_per_view() + col * l.line + row;
    float sum = 0, along[3];
    for (std::size_t c = 0; c < 3; ++c, at += l.line) {
      sum += at[0] + at[1] + at[2];
      along[c] = at[0] - 2 * at[1] + at[2];
    }
    out.push_back({sum, std::abs(along[0] - 2 * along[1] + along[2])});
  }
  return out;
}

}  // namespace

double noise_level(std::span<const float> images, const Layout& layout) {
  std::vector<Sample> samples = samples_of(images, layout);
  if (samples.size() < kClasses) return 0;
  std::ranges::sort(samples);
  double square = 0;
  for (std::size_t c = 0; c < kClasses; ++c) {
    const auto at = [&](std::size_t share) {
      return samples.begin() + static_cast<std::ptrdiff_t>(samples.size() * share / kClasses);
    };
    const auto begin = at(c), end = at(c + 1), middle = begin + (end - begin) / 2;
    std::ranges::nth_element(begin, middle, end, {}, &Sample::detail);
    // The median of |N(0, 1)| is 0.6745; the squares of the nine coefficients sum to 36.
    const double sigma = static_cast<double>(middle->detail) / (0.6745 * 6);
    square += sigma * sigma / static_cast<double>(kClasses);
  }
  return std::sqrt(square);
}

}  // namespace flamefield
