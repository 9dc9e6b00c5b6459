#include "services/acquisition/operator.h"

#include <algorithm>
#include <thread>

namespace flamefield {

namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

}  // namespace

Result<Operator> Operator::connect(Bus& bus, const std::string& role, const std::string& acquisition_endpoint,
                                   const std::string& dispatcher_endpoint) {
  auto acquisition = Client::connect(bus, role, unique_name("operator"), acquisition_endpoint);
  if (!acquisition) return tl::unexpected(acquisition.error());
  auto dispatcher = Client::connect(bus, role, unique_name("operator"), dispatcher_endpoint);
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  return Operator(std::move(*acquisition), std::move(*dispatcher));
}

Result<CaptureState> Operator::capture(const StartCapture& request, const Progress& progress,
                                       std::stop_token stop) {
  auto state = acquisition_.ask_for<CaptureState>(request, seconds(30));
  while (state && is_capturing(state->phase)) {
    if (stop.stop_requested()) return acquisition_.ask_for<CaptureState>(StopCapture{}, seconds(60));
    progress(state->sets_stored, request.pulses);
    std::this_thread::sleep_for(milliseconds(50));
    state = acquisition_.ask_for<CaptureState>(GetCapture{}, seconds(30));  // draining may take a while
  }
  if (state) progress(state->sets_stored, request.pulses);
  return state;
}

Result<std::vector<FrameSet>> Operator::fetch(const std::string& capture, std::int64_t sets) {
  std::vector<FrameSet> out;
  for (std::int64_t index = 0; index < sets; ++index) {
    auto data = dispatcher_.ask_for<SetData>(FetchSet{{capture, index}}, seconds(30));
    if (!data) return tl::unexpected(data.error());
    out.push_back(std::move(data->set));
  }
  return out;
}

}  // namespace flamefield
