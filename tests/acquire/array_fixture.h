#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "acquire/camera_array.h"
#include "acquire/simulator/simulated_array.h"
#include "tests/support/slowdown.h"

namespace flamefield {

// Tests run side by side, and the control port is the same for all cameras: each process has its own
// addresses.
inline std::string first_test_address() {
  const auto pid = static_cast<unsigned>(::getpid());
  return concat("127.", 64 + (pid >> 8) % 128, ".", pid & 255, ".2");
}

inline SimulatedArrayOptions small_array(std::size_t cameras) {
  SimulatedArrayOptions options;
  options.cameras = cameras;
  options.width_px = 64;
  options.height_px = 48;
  options.first_address = first_test_address();
  options.sensor = SensorModel::ideal();
  return options;
}

inline std::vector<CameraAddress> addresses_of(const SimulatedArray& array) {
  std::vector<CameraAddress> out;
  const auto names = array.names(), addresses = array.addresses();
  for (std::size_t i = 0; i < names.size(); ++i) out.push_back({names[i], addresses[i]});
  return out;
}

// A level of 12 bits that only this camera shows at this pulse at this pixel.
inline int coded_level(std::size_t camera, std::int64_t pulse, int x, int y) {
  return static_cast<int>((camera * 131 + static_cast<std::size_t>(pulse) * 17 +
                           static_cast<std::size_t>(x) * 7 + static_cast<std::size_t>(y) * 29) %
                          4096);
}

inline Scene coded_scene(int width_px, int height_px) {
  return [=](std::size_t camera, const Pulse& pulse) {
    auto image = std::make_shared<Image>(width_px, height_px);
    for (int y = 0; y < height_px; ++y) {
      for (int x = 0; x < width_px; ++x) {
        image->at(x, y) = static_cast<float>(coded_level(camera, pulse.number, x, y));
      }
    }
    return image;
  };
}

// True when each pixel is the coded level of this camera and pulse number of the generator.
inline ::testing::AssertionResult shows(const Frame& frame, std::size_t camera, std::int64_t pulse) {
  const auto image = grey_levels(frame);
  if (!image) return ::testing::AssertionFailure() << image.error().message;
  for (int y = 0; y < image->height_px; ++y) {
    for (int x = 0; x < image->width_px; ++x) {
      const int level = coded_level(camera, pulse, x, y);
      const int wanted = frame.format == PixelFormat::Mono8    ? level >> 4
                         : frame.format == PixelFormat::Mono16 ? level << 4
                                                               : level;
      if (!(image->at(x, y) == static_cast<float>(wanted))) {
        return ::testing::AssertionFailure() << frame.camera << " pulse " << pulse << " pixel " << x << ","
                                             << y << ": " << image->at(x, y) << " instead of " << wanted;
      }
    }
  }
  return ::testing::AssertionSuccess();
}

// Keeps the sets of a capture; the handler may run on any thread.
class SetCollector {
 public:
  CameraArray::SetHandler handler() {
    return [this](FrameSet set) {
      const std::lock_guard lock(mutex_);
      sets_.push_back(std::move(set));
    };
  }
  std::vector<FrameSet> take() {
    const std::lock_guard lock(mutex_);
    return std::exchange(sets_, {});
  }

 private:
  std::mutex mutex_;
  std::vector<FrameSet> sets_;
};

inline std::int64_t losses_of(const CameraReceipt& receipt) {
  std::int64_t sum = 0;
  for (std::int64_t count : receipt.tally.losses) sum += count;
  return sum;
}

inline std::int64_t losses_of(const CameraReceipt& receipt, LossCause cause) {
  return receipt.tally.losses[static_cast<std::size_t>(cause)];
}

// Pulses seen = frames delivered + named losses, for every camera; and sets as promised.
inline void expect_balanced(const CaptureReport& report, const std::vector<FrameSet>& sets) {
  EXPECT_EQ(report.pulses, static_cast<std::int64_t>(sets.size()));
  for (const CameraReceipt& receipt : report.cameras) {
    const CameraTally& tally = receipt.tally;
    EXPECT_EQ(report.pulses, tally.delivered + losses_of(receipt)) << receipt.camera;
    EXPECT_EQ(tally.frames_in, tally.delivered + tally.late + tally.duplicates + tally.unwanted +
                                   tally.before_start + tally.implausible + tally.extra)
        << receipt.camera;
  }
  for (std::size_t i = 0; i < sets.size(); ++i) {
    EXPECT_EQ(sets[i].pulse, static_cast<std::int64_t>(i) + 1);
    EXPECT_EQ(sets[i].index, static_cast<std::int64_t>(i));
    EXPECT_EQ(sets[i].frames.size() + sets[i].losses.size(), report.cameras.size());
  }
}

class CameraArrayTest : public ::testing::Test {
 protected:
  void open(const SimulatedArrayOptions& options, CameraSettings settings = {}) {
    auto simulated = SimulatedArray::open(options);
    ASSERT_TRUE(simulated) << simulated.error().message;
    simulated_ = std::move(*simulated);
    simulated_->set_scene(coded_scene(options.width_px, options.height_px));
    auto array = CameraArray::open(addresses_of(*simulated_), settings);
    ASSERT_TRUE(array) << array.error().message;
    array_ = std::move(*array);
  }
  // One burst from arming to the receipt.
  std::vector<FrameSet> capture(std::int64_t pulses, double rate_hz) {
    SetCollector collector;
    const auto started = array_->start({.capture = "test", .pulses = pulses}, collector.handler());
    EXPECT_TRUE(started) << (started ? "" : started.error().message);
    if (!started) return {};
    simulated_->generator().start(rate_hz / testing_support::kSlowdown, pulses);
    EXPECT_TRUE(array_->wait_done(testing_support::kSlowdown * std::chrono::seconds(20)));
    report_ = array_->stop();
    std::vector<FrameSet> sets = collector.take();
    expect_balanced(report_, sets);
    return sets;
  }
  void expect_all_there(const std::vector<FrameSet>& sets, std::int64_t pulses_before) {
    for (const FrameSet& set : sets) {
      EXPECT_TRUE(set.losses.empty()) << "pulse " << set.pulse;
      for (std::size_t i = 0; i < set.frames.size(); ++i) {
        EXPECT_EQ(set.frames[i].camera, array_->names()[i]);
        EXPECT_TRUE(shows(set.frames[i], i, set.pulse + pulses_before));
      }
    }
  }

  std::unique_ptr<SimulatedArray> simulated_;
  std::unique_ptr<CameraArray> array_;
  CaptureReport report_;
};

}  // namespace flamefield
