#include <chrono>
#include <set>
#include <thread>

#include "proto/utc.h"
#include "services/dispatcher/set_sender.h"
#include "services/recording/recording.h"

namespace flamefield {

namespace {

using Clock = std::chrono::steady_clock;

std::vector<std::string> cameras_of(const FrameSet& set) {
  std::set<std::string> names;
  for (const Frame& frame : set.frames) names.insert(frame.camera);
  for (const FrameLoss& loss : set.losses) names.insert(loss.camera);
  return {names.begin(), names.end()};
}

}  // namespace

Result<ReplayReport> replay(const FrameReader& recording, Bus& bus, const std::string& dispatcher_endpoint,
                            const ReplayOptions& options, const RecordingProgress& progress,
                            std::stop_token stop) {
  if (recording.sets() == 0) return invalid_input("the recording", "has no sets", "choose another one");
  auto client = Client::connect(bus, "capture", unique_name("replay"), dispatcher_endpoint);
  if (!client) return tl::unexpected(client.error());
  Dealer dealer(bus, "capture", unique_name("replay-sets"));
  if (auto ok = dealer.connect(dispatcher_endpoint); !ok) return tl::unexpected(ok.error());
  SetSender sender(std::move(dealer), {.max_unacked = 16});

  const auto first = recording.read(0);
  if (!first) return tl::unexpected(first.error());
  PutCapture capture{options.capture, first->kind, utc_now_ns(), 0, 0, cameras_of(*first)};
  capture.pulses_wanted = static_cast<std::int64_t>(recording.sets());
  if (auto ok = client->ask_for<Accepted>(capture, std::chrono::seconds(10)); !ok)
    return tl::unexpected(ok.error());
  const auto begin = Clock::now();
  ReplayReport report;
  for (std::size_t i = 0; i < recording.sets() && !stop.stop_requested(); ++i) {
    auto set = recording.read(i);
    if (!set) return tl::unexpected(set.error());
    const auto due = begin + std::chrono::nanoseconds(set->pulse_time_ns - first->pulse_time_ns);
    while (options.keeps_time && Clock::now() < due && !stop.stop_requested()) {
      sender.pump(std::chrono::milliseconds(1));
      const auto wait = std::min<Clock::duration>(due - Clock::now(), std::chrono::milliseconds(5));
      if (wait.count() > 0) std::this_thread::sleep_for(wait);
    }
    // New times: latencies of the replay are its own.
    set->capture = options.capture;
    set->index = static_cast<std::int64_t>(i);
    const std::int64_t shift_ns = utc_now_ns() - set->complete_time_ns;
    set->pulse_time_ns += shift_ns;
    set->complete_time_ns += shift_ns;
    while (!sender.offer(*set)) sender.pump(std::chrono::milliseconds(20));
    sender.pump(std::chrono::milliseconds(0));
    progress(++report.sets, static_cast<std::int64_t>(recording.sets()));
  }
  if (auto ok = sender.drain(std::chrono::seconds(60)); !ok) return tl::unexpected(ok.error());
  report.seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  capture.finished_time_ns = utc_now_ns();
  capture.pulses = report.sets;
  capture.end = stop.stop_requested() ? CaptureEnd::Stopped : CaptureEnd::Complete;
  if (auto ok = client->ask_for<Accepted>(capture, std::chrono::seconds(10)); !ok)
    return tl::unexpected(ok.error());
  return report;
}

}  // namespace flamefield
