#include "reconstruct/noise_model.h"

#include <algorithm>
#include <cmath>
#include <compare>

namespace flamefield {

std::vector<SettingField> fields_of(NoiseModel& o) {
  return {{"sigma", "", 0, 1, "standard deviation of a dark pixel, share of the brightest", &o.sigma},
          {"photons", "", 0, 1e12, "photons at the brightest pixel; 0: no shot noise", &o.photons}};
}

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

std::vector<NoiseClass> noise_by_brightness(std::span<const float> images, const Layout& layout) {
  std::vector<Sample> samples = samples_of(images, layout);
  if (samples.size() < kClasses) return {};
  std::ranges::sort(samples);
  std::vector<NoiseClass> out(kClasses);
  for (std::size_t c = 0; c < kClasses; ++c) {
    const auto at = [&](std::size_t share) {
      return samples.begin() + static_cast<std::ptrdiff_t>(samples.size() * share / kClasses);
    };
    const auto begin = at(c), end = at(c + 1), middle = begin + (end - begin) / 2;
    for (auto s = begin; s != end; ++s) out[c].brightness += static_cast<double>(s->brightness) / 9;
    out[c].brightness /= static_cast<double>(end - begin);
    std::ranges::nth_element(begin, middle, end, {}, &Sample::detail);
    // The median of |N(0, 1)| is 0.6745; the squares of the nine coefficients sum to 36.
    out[c].variance = std::pow(static_cast<double>(middle->detail) / (0.6745 * 6), 2);
  }
  return out;
}

double noise_level(std::span<const float> images, const Layout& layout) {
  double square = 0;
  for (const NoiseClass& c : noise_by_brightness(images, layout)) square += c.variance / kClasses;
  return std::sqrt(square);
}

NoiseModel estimate_noise(std::span<const float> images, const Layout& layout) {
  constexpr double kLeastVariance = 1e-10;  // of a class in which nothing varies
  double one = 0, b = 0, bb = 0, v = 0, bv = 0;
  for (const NoiseClass& c : noise_by_brightness(images, layout)) {
    const double weight = std::pow(c.variance + kLeastVariance, -2), bright = std::max(c.brightness, 0.0);
    one += weight, b += weight * bright, bb += weight * bright * bright;
    v += weight * c.variance, bv += weight * bright * c.variance;
  }
  if (!(one > 0)) return {};
  const double spread = one * bb - b * b;
  double slope = spread > 1e-12 * one * bb ? std::max(0.0, (one * bv - b * v) / spread) : 0;
  if (slope * b > v) slope = bb > 0 ? bv / bb : 0;  // no read noise: a line through the origin
  NoiseModel noise;
  noise.sigma = std::sqrt(std::max(0.0, (v - slope * b) / one));
  if (slope > 0) noise.photons = 1 / slope;
  return noise;
}

double expected_residual(const NoiseModel& noise, std::span<const float> images, const Layout& layout) {
  double norm = 0, variance = 0;
  for (int v = 0; v < layout.views; ++v)
    for (int col = 0; col < layout.cols; ++col)
      for (int row = 0; row < layout.rows; ++row) {
        const double b = images[layout.pixel(v, row, col)];
        norm += b * b;
        variance += noise.variance(b);
      }
  return norm > 0 ? std::sqrt(variance / norm) : 0;
}

}  // namespace flamefield
