// POST capture, POST capture/stop
#include <nlohmann/json.hpp>

#include "services/api/call.h"
#include "services/api/records_json.h"

namespace flamefield {
namespace {

// Arming fifteen cameras takes a second, draining a long capture a few. The page sees both in the status
// anyway, and the gateway must not wait long for its own end.
constexpr std::chrono::seconds kArming{15}, kDraining{20};

HttpResponse start(const Call& call) {
  const auto body = call.body();
  if (!body) return error_answer(body.error());
  const std::string name = body->value("kind", "");
  const auto kind = capture_kind_from_name(name);
  if (!kind) return json_error(400, "kind must be dark, background, flat, board, burst or live");
  const auto pulses = body->value("pulses", std::int64_t{0});
  if (pulses < 0 || pulses > 1'000'000) return json_error(400, "pulses must be 0 (until stopped) to 1000000");
  if (pulses == 0 && *kind != CaptureKind::Live)
    return json_error(400, "pulses are missing: only a live capture goes on until it is stopped");
  const auto state =
      call.services.ask_array<CaptureState>(StartCapture{.kind = *kind, .pulses = pulses, .id = ""}, kArming);
  return state ? json_answer(json_of(*state), 202) : error_answer(state.error());
}

}  // namespace

std::optional<HttpResponse> answer_array(const Call& call) {
  if (call.request.method != "POST" || call.parts[0] != "capture") return std::nullopt;
  if (call.parts.size() == 1) return start(call);
  if (call.parts.size() != 2 || call.parts[1] != "stop") return std::nullopt;
  const auto state = call.services.ask_array<CaptureState>(StopCapture{}, kDraining);
  return state ? json_answer(json_of(*state)) : error_answer(state.error());
}

}  // namespace flamefield
