#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <memory>
#include <optional>
#include <string>
#include <thread>

#include "acquire/simulator/simulated_array.h"
#include "acquire/simulator/test_image.h"
#include "services/acquisition/acquisition.h"
#include "services/bus/client.h"
#include "services/ledger/reader.h"
#include "tests/services/support.h"

// A few small cameras that really stream, and the services that capture from them, in one process.
namespace flamefield::testing_support {

// Away from the addresses of the other test programs.
inline std::string own_loopback_address() {
  const auto pid = static_cast<unsigned>(::getpid());
  return concat("127.", 20 + (pid >> 8) % 40, ".", pid & 255, ".2");
}

inline std::vector<CameraAddress> addresses_of(const SimulatedArray& array) {
  std::vector<CameraAddress> out;
  const auto names = array.names(), addresses = array.addresses();
  for (std::size_t i = 0; i < names.size(); ++i) out.push_back({names[i], addresses[i]});
  return out;
}

inline SimulatedArrayOptions tiny_array(std::size_t cameras) {
  SimulatedArrayOptions options;
  options.cameras = cameras;
  options.width_px = 64;
  options.height_px = 48;
  options.first_address = own_loopback_address();
  options.sensor = SensorModel::ideal();
  return options;
}

// True when every picture of the set is of this pulse of the generator, as its pixels say.
inline ::testing::AssertionResult shows_pulse(const FrameSet& set, std::int64_t pulse) {
  for (const Frame& frame : set.frames) {
    const auto stamp = read_test_image(frame);
    if (!stamp) return ::testing::AssertionFailure() << frame.camera << " shows no test image";
    if (stamp->pulse != pulse || concat("cam0", stamp->camera) != frame.camera || stamp->is_stray)
      return ::testing::AssertionFailure() << frame.camera << " shows pulse " << stamp->pulse << " of camera "
                                           << stamp->camera << ", not pulse " << pulse;
  }
  return ::testing::AssertionSuccess();
}

// The capturing service with its generator; the dispatcher is somebody else's.
class Capturer {
 public:
  Capturer(Bus& bus, SimulatedArray& array, double rate_hz, AcquisitionOptions options) {
    SignalGenerator& generator = array.generator();
    options.cameras = addresses_of(array);
    options.settings.test_image = true;
    if (options.action_rate_hz == 0) {
      options.hooks = {
          .before = {},
          .armed = [&generator, rate_hz](
                       CaptureKind, std::int64_t pulses) { generator.start(rate_hz / kSlowdown, pulses); },
          .finished = [&generator] { generator.stop(); }};
    }
    auto opened = Acquisition::open(bus, std::move(options));
    EXPECT_TRUE(opened) << (opened ? "" : opened.error().message);
    if (!opened) return;
    service_ = std::move(*opened);
    thread_ = std::jthread([this](std::stop_token stop) { EXPECT_TRUE(service_->run(stop)); });
    client_.emplace(
        Client::connect(bus, "operator", unique_name("operator"), "inproc://acquisition").value());
  }
  CaptureState ask(const Message& question) {
    auto state = client_->ask_for<CaptureState>(question, kSlowdown * std::chrono::seconds(40));
    EXPECT_TRUE(state) << (state ? "" : state.error().message);
    return state.value_or(CaptureState{});
  }
  std::string refusal_of(const Message& question) {
    const auto answer = client_->ask(question, std::chrono::seconds(10));
    return answer ? "accepted" : answer.error().message;
  }
  CaptureState now() { return service_->state(); }
  // From the request to the last set on disk.
  CaptureState capture(const StartCapture& request) {
    CaptureState state = ask(request);
    EXPECT_TRUE(eventually([&] { return !is_capturing((state = now()).phase); }, std::chrono::seconds(30)));
    return state;
  }
  Acquisition& service() { return *service_; }

 private:
  std::unique_ptr<Acquisition> service_;
  std::jthread thread_;
  std::optional<Client> client_;
};

}  // namespace flamefield::testing_support
