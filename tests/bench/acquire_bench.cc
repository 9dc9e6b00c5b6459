// Latency from the trigger edge to the grouped set, over real sockets on the loopback interface.
// usage: bench_acquire [cameras] [rate_hz] [pulses] [Mono8|Mono12] [packet_size_bytes]
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "acquire/camera_array.h"
#include "acquire/simulator/simulated_array.h"
#include "proto/utc.h"

using namespace flamefield;

namespace {

double cpu_s() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

int fail(const Error& error) {
  std::fprintf(stderr, "%s\n", error.message.c_str());
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  const auto argument = [&](int i, const char* otherwise) {
    return std::string(argc > i ? argv[i] : otherwise);
  };
  SimulatedArrayOptions options;
  options.cameras = std::stoul(argument(1, "15"));
  options.first_address = "127.99.0.2";
  const double rate_hz = std::stod(argument(2, "5"));
  const std::int64_t pulses = std::stoll(argument(3, "150"));
  CameraSettings settings;
  settings.pixel_format = pixel_format_from_name(argument(4, "Mono8")).value_or(PixelFormat::Mono8);
  settings.packet_size_bytes = std::stoi(argument(5, "1500"));

  auto simulated = SimulatedArray::open(options);
  if (!simulated) return fail(simulated.error());
  std::mutex mutex;
  std::vector<std::int64_t> edges_ns(static_cast<std::size_t>(pulses), 0);
  const auto light = std::make_shared<const Image>(options.width_px, options.height_px, 6000.0f);
  (*simulated)->set_scene([&](std::size_t, const Pulse& pulse) {
    const std::lock_guard lock(mutex);
    if (pulse.index < pulses) edges_ns[static_cast<std::size_t>(pulse.index)] = pulse.time_ns;
    return light;
  });
  std::vector<CameraAddress> addresses;
  for (std::size_t i = 0; i < options.cameras; ++i) {
    addresses.push_back({(*simulated)->names()[i], (*simulated)->addresses()[i]});
  }
  const std::int64_t open_ns = utc_now_ns();
  auto array = CameraArray::open(addresses, settings);
  if (!array) return fail(array.error());
  std::vector<double> latencies_ms;
  const auto on_set = [&](const FrameSet& set) {
    const std::int64_t now_ns = utc_now_ns();
    const std::lock_guard lock(mutex);
    if (!set.losses.empty()) return;
    latencies_ms.push_back(1e-6 *
                           static_cast<double>(now_ns - edges_ns[static_cast<std::size_t>(set.index)]));
  };
  if (auto ok = (*array)->start({.capture = "bench", .pulses = pulses}, on_set); !ok) return fail(ok.error());
  const double armed_ms = 1e-6 * static_cast<double>(utc_now_ns() - open_ns);
  const double cpu_before_s = cpu_s();
  const auto begin = std::chrono::steady_clock::now();
  (*simulated)->generator().start(rate_hz, pulses);
  (*array)->wait_done(std::chrono::seconds(5 + static_cast<int>(static_cast<double>(pulses) / rate_hz)));
  const double wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  const double used_s = cpu_s() - cpu_before_s;
  const CaptureReport report = (*array)->stop();
  std::sort(latencies_ms.begin(), latencies_ms.end());
  const auto quantile = [&](double q) {
    if (latencies_ms.empty()) return 0.0;
    return latencies_ms[static_cast<std::size_t>(q * static_cast<double>(latencies_ms.size() - 1) + 0.5)];
  };
  std::printf(
      "cameras %zu  rate_hz %g  pulses %ld  complete_sets %ld  pulse_to_set_ms p50 %.1f p99 %.1f max %.1f  "
      "opened_and_armed_ms %.0f  cpu_of_simulator_and_client %.0f%% of a core\n",
      options.cameras, rate_hz, static_cast<long>(report.pulses), static_cast<long>(report.complete_sets),
      quantile(0.5), quantile(0.99), quantile(1), armed_ms, 100 * used_s / wall_s);
  return report.complete_sets == pulses ? 0 : 1;
}
