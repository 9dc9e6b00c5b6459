#include "reconstruct/noise_model.h"

#include <algorithm>
#include <cmath>

namespace flamefield {

std::vector<SettingField> fields_of(NoiseModel& o) {
  return {{"sigma", "", 0, 1, "standard deviation of a dark pixel, share of the brightest", &o.sigma},
          {"photons", "", 0, 1e12, "photons at the brightest pixel; 0: no shot noise", &o.photons}};
}

namespace {

// Standard deviation of the noise behind differences that are N(0, 36 sigma^2), from their median size.
double robust_sigma(std::vector<float>& sizes) {
  if (sizes.empty()) return 0;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return *middle / 0.6745 / 6;
}

}  // namespace

NoiseModel estimate_noise(std::span<const float> images, const Layout& layout) {
  constexpr float kBright = 0.2f;  // of local means: dark below a quarter of it
  std::vector<float> dark, bright;
  double bright_sum = 0;
  for (int v = 0; v < layout.views; ++v)
    for (int col = 1; col + 1 < layout.cols; ++col) {
      const auto at = [&](int row, int c) { return images[layout.pixel(v, row, c)]; };
      for (int row = 1; row + 1 < layout.rows; ++row) {
        const float centre = at(row, col);
        const float sides = at(row - 1, col) + at(row + 1, col) + at(row, col - 1) + at(row, col + 1);
        const float corners =
            at(row - 1, col - 1) + at(row - 1, col + 1) + at(row + 1, col - 1) + at(row + 1, col + 1);
        const float size = std::abs(4 * centre - 2 * sides + corners), mean = (centre + sides + corners) / 9;
        if (mean > kBright) {
          bright.push_back(size);
          bright_sum += mean;
        } else if (mean < kBright / 4) {
          dark.push_back(size);
        }
      }
    }
  const double bright_mean = bright.empty() ? 0 : bright_sum / static_cast<double>(bright.size());
  NoiseModel noise;
  const double dark_sigma = robust_sigma(dark), bright_sigma = robust_sigma(bright);
  constexpr std::size_t kEnough = 100;
  noise.sigma = dark.size() >= kEnough ? std::min(dark_sigma, bright_sigma) : bright_sigma;
  const double excess = bright_sigma * bright_sigma - noise.sigma * noise.sigma;
  if (excess > 0 && bright_mean > 0) noise.photons = bright_mean / excess;
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
