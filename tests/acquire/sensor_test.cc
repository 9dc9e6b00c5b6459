#include "acquire/simulator/sensor.h"

#include <gtest/gtest.h>

#include <cmath>

#include "acquire/simulator/scene.h"

namespace flamefield {
namespace {

constexpr int kWidth_px = 160, kHeight_px = 120;

Sensor::Readout whole_frame(PixelFormat format = PixelFormat::Mono12) {
  return {.format = format, .width_px = kWidth_px, .height_px = kHeight_px, .exposure_us = kSceneExposure_us};
}

Image levels(const Sensor& sensor, const Image* light, const Sensor::Readout& readout,
             std::int64_t pulse = 1) {
  Frame frame;
  frame.width_px = readout.width_px;
  frame.height_px = readout.height_px;
  frame.format = readout.format;
  const auto bytes = sensor.expose(light, readout, pulse);
  frame.bytes = std::make_shared<const std::vector<std::byte>>(
      reinterpret_cast<const std::byte*>(bytes.data()),
      reinterpret_cast<const std::byte*>(bytes.data() + bytes.size()));
  return grey_levels(frame).value();
}

struct Moments {
  double mean = 0, variance = 0;
};
Moments moments(const Image& image) {
  Moments out;
  for (float value : image.pixels) out.mean += value;
  out.mean /= static_cast<double>(image.pixels.size());
  for (float value : image.pixels) out.variance += (value - out.mean) * (value - out.mean);
  out.variance /= static_cast<double>(image.pixels.size());
  return out;
}

TEST(Sensor, IdealOneReadsElectronsAsLevels) {
  const Sensor sensor(SensorModel::ideal(), kWidth_px, kHeight_px, 1);
  Image light(kWidth_px, kHeight_px);
  for (std::size_t i = 0; i < light.pixels.size(); ++i) light.pixels[i] = static_cast<float>(i % 5000);
  const Image image = levels(sensor, &light, whole_frame());
  for (std::size_t i = 0; i < light.pixels.size(); ++i) {
    ASSERT_EQ(image.pixels[i], static_cast<float>(std::min<std::size_t>(i % 5000, 4095)));
  }
}

TEST(Sensor, NoiseFollowsThePhotonTransferCurve) {
  // EMVA 1288, eq. (14): var = K^2 (read^2 + electrons) + 1/12, for a flat field.
  SensorModel model;
  model.vignetting = 0;
  model.hot_pixel_fraction = 0;
  const Sensor sensor(model, kWidth_px, kHeight_px, 7);
  const double gain = 4095 / model.full_well_e;
  for (const float electrons : {0.0f, 1000.0f, 5000.0f, 12000.0f}) {
    const Image light(kWidth_px, kHeight_px, electrons);
    const Moments got = moments(levels(sensor, &light, whole_frame()));
    const double variance = gain * gain * (model.read_noise_e * model.read_noise_e + electrons) + 1.0 / 12;
    const double n = kWidth_px * kHeight_px;
    EXPECT_NEAR(got.mean, model.dark_level_dn12 + gain * electrons, 5 * std::sqrt(variance / n));
    EXPECT_NEAR(got.variance / variance, 1, 5 * std::sqrt(2 / n) + 0.01) << electrons;
  }
}

TEST(Sensor, SamePulseGivesTheSamePictureAndAnotherPulseAnother) {
  const Image light(kWidth_px, kHeight_px, 3000);
  const Sensor sensor({}, kWidth_px, kHeight_px, 3), twin({}, kWidth_px, kHeight_px, 3);
  EXPECT_EQ(sensor.expose(&light, whole_frame(), 5), twin.expose(&light, whole_frame(), 5));
  EXPECT_NE(sensor.expose(&light, whole_frame(), 5), sensor.expose(&light, whole_frame(), 6));
}

TEST(Sensor, ExposureAndGainScaleTheSignal) {
  const Sensor sensor(SensorModel::ideal(), kWidth_px, kHeight_px, 1);
  const Image light(kWidth_px, kHeight_px, 1000);
  Sensor::Readout readout = whole_frame();
  readout.exposure_us = 2 * kSceneExposure_us;
  EXPECT_EQ(moments(levels(sensor, &light, readout)).mean, 2000);
  readout.exposure_us = kSceneExposure_us;
  readout.gain_raw = 168;  // 0.0359 dB a step: 6.03 dB
  EXPECT_NEAR(moments(levels(sensor, &light, readout)).mean, 2002, 2);
}

TEST(Sensor, CornersGetLessLightThanTheMiddle) {
  SensorModel model = SensorModel::ideal();
  model.vignetting = 0.25;
  const Sensor sensor(model, kWidth_px, kHeight_px, 1);
  const Image light(kWidth_px, kHeight_px, 2000);
  const Image image = levels(sensor, &light, whole_frame());
  EXPECT_EQ(image.at(0, 0), 1500);
  EXPECT_NEAR(image.at(kWidth_px / 2, kHeight_px / 2), 2000, 1);
}

TEST(Sensor, RegionOfInterestIsCutOutOfTheWholePicture) {
  const Sensor sensor({}, kWidth_px, kHeight_px, 9);
  const Image light(kWidth_px, kHeight_px, 4000);
  const Image whole = levels(sensor, &light, whole_frame());
  Sensor::Readout readout = whole_frame();
  readout.offset_x_px = 30;
  readout.offset_y_px = 20;
  readout.width_px = 41;
  readout.height_px = 33;
  for (PixelFormat format : {PixelFormat::Mono12, PixelFormat::Mono12Packed}) {
    readout.format = format;
    const Image part = levels(sensor, &light, readout);
    for (int y = 0; y < 33; ++y) {
      for (int x = 0; x < 41; ++x) ASSERT_EQ(part.at(x, y), whole.at(x + 30, y + 20));
    }
  }
}

TEST(Sensor, HotPixelsGlowInTheDarkAndStayWhereTheyAre) {
  SensorModel model;
  model.hot_pixel_fraction = 0.01;
  const Sensor sensor(model, kWidth_px, kHeight_px, 4);
  const auto hot = [&](std::int64_t pulse) {
    const Image dark = levels(sensor, nullptr, whole_frame(), pulse);
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < dark.pixels.size(); ++i) {
      if (dark.pixels[i] > model.dark_level_dn12 + 100) out.push_back(i);
    }
    return out;
  };
  EXPECT_GT(hot(1).size(), 60u);
  EXPECT_LT(hot(1).size(), 300u);
  std::vector<std::size_t> both;
  const auto a = hot(1), b = hot(2);
  std::set_intersection(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(both));
  EXPECT_GT(static_cast<double>(both.size()), 0.9 * static_cast<double>(a.size()));
}

}  // namespace
}  // namespace flamefield
