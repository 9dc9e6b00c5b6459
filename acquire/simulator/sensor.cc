#include "acquire/simulator/sensor.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "acquire/simulator/scene.h"
#include "proto/check.h"

namespace flamefield {

namespace {

constexpr double kLevels12 = 4095;
constexpr std::size_t kQuantileBits = 14;

// splitmix64 (Steele, Lea, Flood, OOPSLA 2014): a counter in, independent bits out.
std::uint64_t mix(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ull;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ull;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebull;
  return x ^ (x >> 31);
}

// Quantiles at the middles of equal-probability bins, by bisection of the distribution function, rescaled to
// unit variance, which the cut tails would otherwise miss.
std::vector<float> normal_quantiles() {
  const std::size_t n = std::size_t{1} << kQuantileBits;
  std::vector<double> values(n);
  double sum_of_squares = 0;
  for (std::size_t i = 0; i < n; ++i) {
    const double probability = (static_cast<double>(i) + 0.5) / static_cast<double>(n);
    double low = -6, high = 6;
    for (int step = 0; step < 40; ++step) {
      const double middle = 0.5 * (low + high);
      (0.5 * std::erfc(-middle / std::sqrt(2.0)) < probability ? low : high) = middle;
    }
    values[i] = low;
    sum_of_squares += low * low;
  }
  const double scale = 1 / std::sqrt(sum_of_squares / static_cast<double>(n));
  std::vector<float> quantiles(n);
  std::transform(values.begin(), values.end(), quantiles.begin(),
                 [scale](double value) { return static_cast<float>(value * scale); });
  return quantiles;
}

// Levels of 12 bits -> bytes on the wire.
std::vector<std::uint8_t> pack(PixelFormat format, const std::vector<std::uint16_t>& levels) {
  const std::size_t n = levels.size();
  switch (format) {
    case PixelFormat::Mono8: {
      std::vector<std::uint8_t> out(n);
      for (std::size_t i = 0; i < n; ++i) out[i] = static_cast<std::uint8_t>(levels[i] >> 4);
      return out;
    }
    case PixelFormat::Mono12Packed: {
      std::vector<std::uint8_t> out((n * 3 + 1) / 2);
      for (std::size_t i = 0; i < n; ++i) {
        const std::size_t group = i / 2 * 3;
        const bool is_first = i % 2 == 0;
        out[is_first ? group : group + 2] = static_cast<std::uint8_t>(levels[i] >> 4);
        out[group + 1] = static_cast<std::uint8_t>(out[group + 1] | (levels[i] & 15) << (is_first ? 0 : 4));
      }
      return out;
    }
    case PixelFormat::Mono12:
    case PixelFormat::Mono16:
      break;
  }
  const int shift = format == PixelFormat::Mono16 ? 4 : 0;
  std::vector<std::uint8_t> out(2 * n);
  for (std::size_t i = 0; i < n; ++i) {
    out[2 * i] = static_cast<std::uint8_t>(levels[i] << shift);
    out[2 * i + 1] = static_cast<std::uint8_t>(levels[i] << shift >> 8);
  }
  return out;
}

}  // namespace

SensorModel SensorModel::ideal() {
  return {.full_well_e = kLevels12,
          .read_noise_e = 0,
          .has_shot_noise = false,
          .dark_level_dn12 = 0,
          .vignetting = 0,
          .hot_pixel_fraction = 0};
}

Sensor::Sensor(const SensorModel& model, int width_px, int height_px, std::uint64_t seed)
    : model_(model), width_px_(width_px), height_px_(height_px), seed_(mix(seed)) {
  expect(width_px > 0 && height_px > 0, "a sensor has pixels");
  static const std::vector<float> quantiles = normal_quantiles();
  normals_ = quantiles;
  const std::size_t pixels = static_cast<std::size_t>(width_px) * static_cast<std::size_t>(height_px);
  vignetting_.resize(pixels);
  dark_e_.resize(pixels, 0);
  const double cx = 0.5 * (width_px - 1), cy = 0.5 * (height_px - 1);
  const double corner2 = std::max(cx * cx + cy * cy, 1.0);
  std::mt19937_64 random(seed_);
  std::uniform_real_distribution<double> chance(0, 1);
  std::exponential_distribution<double> charge(1);
  std::size_t i = 0;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x, ++i) {
      const double radius2 = (x - cx) * (x - cx) + (y - cy) * (y - cy);
      vignetting_[i] = static_cast<float>(1 - model.vignetting * radius2 / corner2);
      if (chance(random) < model.hot_pixel_fraction) {
        dark_e_[i] = static_cast<float>(model.hot_pixel_e * charge(random));
      }
    }
  }
}

std::vector<std::uint8_t> Sensor::expose(const Image* light, const Readout& readout,
                                         std::int64_t pulse) const {
  expect(readout.offset_x_px >= 0 && readout.offset_y_px >= 0 && readout.width_px > 0 &&
             readout.height_px > 0 && readout.binning_x > 0 && readout.binning_y > 0 &&
             (readout.offset_x_px + readout.width_px) * readout.binning_x <= width_px_ &&
             (readout.offset_y_px + readout.height_px) * readout.binning_y <= height_px_,
         "the region of interest is on the sensor");
  if (light && (light->width_px != width_px_ || light->height_px != height_px_)) light = nullptr;
  std::vector<std::uint16_t> levels(static_cast<std::size_t>(readout.width_px) *
                                    static_cast<std::size_t>(readout.height_px));
  const auto exposure = static_cast<float>(readout.exposure_us / kSceneExposure_us);
  const auto full_well = static_cast<float>(model_.full_well_e);
  const auto read_variance = static_cast<float>(model_.read_noise_e * model_.read_noise_e);
  const double gain = std::pow(10, model_.gain_db_per_raw_step * readout.gain_raw / 20);
  const auto levels_per_e = static_cast<float>(kLevels12 / model_.full_well_e * gain);
  const auto dark = static_cast<float>(model_.dark_level_dn12 + readout.black_level_raw);
  const bool has_noise = model_.has_shot_noise || model_.read_noise_e > 0;
  const std::uint64_t stream = mix(seed_ ^ mix(static_cast<std::uint64_t>(pulse)));
  // Charge of one pixel of the sensor.
  const auto charge_at = [&](std::size_t i) {
    const float lit = light ? std::max(light->pixels[i], 0.0f) * vignetting_[i] : 0.0f;
    return (lit + dark_e_[i]) * exposure;
  };
  const auto stride = static_cast<std::size_t>(width_px_);
  std::size_t o = 0;
  for (int y = readout.offset_y_px; y < readout.offset_y_px + readout.height_px; ++y) {
    for (int x = readout.offset_x_px; x < readout.offset_x_px + readout.width_px; ++x, ++o) {
      const std::size_t i = static_cast<std::size_t>(y * readout.binning_y) * stride +
                            static_cast<std::size_t>(x * readout.binning_x);
      float charge = charge_at(i);
      if (readout.binning_x * readout.binning_y > 1) {
        charge = 0;
        for (int by = 0; by < readout.binning_y; ++by) {
          for (int bx = 0; bx < readout.binning_x; ++bx)
            charge += charge_at(i + static_cast<std::size_t>(by) * stride + static_cast<std::size_t>(bx));
        }
      }
      charge = std::min(charge, full_well);
      float level = dark + levels_per_e * charge;
      if (has_noise) {
        const float variance = read_variance + (model_.has_shot_noise ? charge : 0.0f);
        level += levels_per_e * std::sqrt(variance) * normals_[mix(stream + i) >> (64 - kQuantileBits)];
      }
      level = std::clamp(level + 0.5f, 0.0f, static_cast<float>(kLevels12));
      levels[o] = static_cast<std::uint16_t>(static_cast<int>(level));
    }
  }
  return pack(readout.format, levels);
}

}  // namespace flamefield
