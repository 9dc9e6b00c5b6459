#include "reconstruct/averaging.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

namespace flamefield {
namespace {

Frame frame_of(const std::string& camera, const std::vector<int>& levels,
               PixelFormat format = PixelFormat::Mono8) {
  std::vector<std::byte> bytes;
  for (int level : levels) {
    bytes.push_back(static_cast<std::byte>(level & 255));
    if (format != PixelFormat::Mono8) bytes.push_back(static_cast<std::byte>(level >> 8));
  }
  return {.camera = camera,
          .width_px = static_cast<int>(levels.size()),
          .height_px = 1,
          .format = format,
          .bytes = std::make_shared<const std::vector<std::byte>>(bytes)};
}

FrameSet set_of(std::int64_t pulse, double time_s, std::vector<Frame> frames = {}) {
  FrameSet set;
  set.pulse = pulse;
  set.pulse_time_ns = 1'700'000'000'000'000'000 + std::llround(1e9 * time_s);
  set.frames = std::move(frames);
  return set;
}

TEST(MeanImages, AverageTheFramesOfEachCamera) {
  std::vector<FrameSet> sets = {set_of(0, 0, {frame_of("a", {10, 20, 30}), frame_of("b", {1, 1, 1})}),
                                set_of(1, 1, {frame_of("a", {15, 25, 30})}),
                                set_of(2, 2, {frame_of("a", {20, 30, 33})})};
  const auto means = mean_images(sets);
  ASSERT_TRUE(means.has_value());
  EXPECT_EQ(means->images.at("a").pixels, (std::vector<float>{15, 25, 31}));
  EXPECT_EQ(means->images.at("b").pixels, (std::vector<float>{1, 1, 1}));
  EXPECT_EQ(means->sets, 3u);
  sets[1].frames[0].width_px = 2;
  EXPECT_FALSE(mean_images(sets).has_value());
}

TEST(MeanImages, KnowThePixelsThatReachedTheFullScaleOfTheirFormat) {
  const auto means = mean_images(
      {set_of(0, 0, {frame_of("a", {255, 254, 0}), frame_of("b", {255, 4095, 4094}, PixelFormat::Mono12)}),
       set_of(1, 1, {frame_of("a", {255, 3, 255})})});
  ASSERT_TRUE(means.has_value());
  EXPECT_EQ(means->saturated.at("a"), (std::vector<std::uint32_t>{0, 2}));
  EXPECT_EQ(means->saturated.at("b"), (std::vector<std::uint32_t>{1}));
}

std::vector<std::int64_t> pulses_of(const Result<std::vector<FrameSet>>& sets) {
  std::vector<std::int64_t> out;
  if (sets)
    for (const FrameSet& set : *sets) out.push_back(set.pulse);
  return out;
}

TEST(PhaseLock, TakesEveryKthPulseEvenWhereOneWasLost) {
  std::vector<FrameSet> sets;
  for (int pulse : {7, 8, 9, 11, 12, 13}) sets.push_back(set_of(pulse, 0.1 * pulse));
  EXPECT_EQ(pulses_of(phase_locked(sets, {.every = 3})), (std::vector<std::int64_t>{7, 13}));
  EXPECT_EQ(pulses_of(phase_locked(sets, {.every = 3, .first = 1})), (std::vector<std::int64_t>{8, 11}));
  EXPECT_EQ(pulses_of(phase_locked(sets, {})).size(), 6u);
}

TEST(PhaseLock, SortsPulsesIntoPhasesByTheirTimes) {
  // 25 pulses a second of a flame that flickers 10 times a second, triggers up to 2 ms late: five phases.
  std::vector<FrameSet> sets;
  for (int pulse = 0; pulse < 50; ++pulse) sets.push_back(set_of(pulse, pulse / 25.0 + 0.002 * (pulse % 2)));
  std::size_t all = 0;
  for (int bin = 0; bin < 5; ++bin) {
    const auto chosen = phase_locked(sets, {.frequency_hz = 10, .bins = 5, .bin = bin});
    ASSERT_TRUE(chosen.has_value());
    all += chosen->size();
    for (const FrameSet& set : *chosen) {
      const double turns = static_cast<double>(set.pulse) / 25.0 * 10;
      EXPECT_NEAR(std::remainder(turns - bin / 5.0, 1.0), 0, 1e-9) << "pulse " << set.pulse << " in " << bin;
    }
  }
  EXPECT_EQ(all, sets.size());
}

TEST(PhaseLock, ImpossiblePhasesAreRefused) {
  const std::vector<FrameSet> sets = {set_of(0, 0), set_of(1, 0)};
  const auto message = [&](const PhaseLock& lock) {
    const auto chosen = phase_locked(sets, lock);
    return chosen ? std::string("accepted") : chosen.error().message;
  };
  EXPECT_NE(message({.every = 2, .first = 2}).find("first pulse 2 of every 2"), std::string::npos);
  EXPECT_NE(message({.frequency_hz = 10, .bins = 4, .bin = 4}).find("phase 4 of 4"), std::string::npos);
  EXPECT_NE(message({.frequency_hz = 10}).find("without pulse times"), std::string::npos);
  EXPECT_NE(message({.every = 9, .first = 5}).find("nothing to average"), std::string::npos);
}

}  // namespace
}  // namespace flamefield
