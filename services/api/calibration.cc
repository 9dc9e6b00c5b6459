// GET calibration, calibration/rig, calibrations; POST calibration/start, take, solve, accept, discard
#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "services/api/call.h"
#include "services/api/records_json.h"
#include "services/calibration/output.h"
#include "services/store/rig_file.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;

// Arming the array and giving it back takes a second or two; a solution that is under way is waited for.
constexpr std::chrono::seconds kArming{30};
constexpr std::int64_t kMostPoses = 1000;

HttpResponse state_answer(const Result<CalibrationState>& state, int status = 200) {
  if (!state) return error_answer(state.error());
  return json_answer(Json::parse(json_text(*state)), status);
}

// That nobody holds sessions here is an answer, not a failure: the page says so and goes on showing the rest.
HttpResponse current(const Call& call) {
  const auto state = call.services.ask_calibration<CalibrationState>(GetCalibration{});
  if (state || state.error().code != ErrorCode::Unavailable) return state_answer(state);
  return json_answer({{"state", "unavailable"}, {"why", state.error().message}});
}

// The rig that the session has found and nobody has accepted yet.
HttpResponse found_rig(const Call& call) {
  const auto state = call.services.ask_calibration<CalibrationState>(GetCalibration{});
  if (!state) return error_answer(state.error());
  if (state->report.empty()) return json_error(404, "the session has not been solved yet");
  const auto rig = read_rig(call.services.data_dir() / "calibrations" / state->id / "rig.yaml");
  return rig ? json_answer(json_of(*rig, state->id)) : error_answer(rig.error());
}

HttpResponse start(const Call& call, const nlohmann::json& body) {
  StartCalibration request;
  request.wanted_poses = body.value("wanted_poses", request.wanted_poses);
  request.automatic = body.value("automatic", true);
  if (request.wanted_poses < 2 || request.wanted_poses > kMostPoses)
    return json_error(400, concat("wanted_poses must be 2 to ", kMostPoses));
  return state_answer(call.services.ask_calibration<CalibrationState>(request, kArming), 202);
}

HttpResponse accept(const Call& call, const nlohmann::json& body) {
  const AcceptCalibration request{body.value("accepted_by", ""), body.value("note", "")};
  if (request.accepted_by.empty())
    return json_error(400, "accepted_by is missing: the history says who accepted");
  const auto stored = call.services.ask_calibration<CalibrationStored>(request, kArming);
  if (!stored) return error_answer(stored.error());
  return json_answer({{"version", stored->version}, {"rig_id", stored->rig_id}});
}

std::optional<HttpResponse> command(const Call& call, const std::string& what) {
  constexpr std::array<std::string_view, 5> kCommands = {"start", "take", "solve", "accept", "discard"};
  if (std::ranges::find(kCommands, what) == kCommands.end()) return std::nullopt;
  const auto body = call.body();
  if (!body) return error_answer(body.error());
  auto& services = call.services;
  if (what == "start") return start(call, *body);
  if (what == "accept") return accept(call, *body);
  if (what == "take") return state_answer(services.ask_calibration<CalibrationState>(TakePose{}), 202);
  if (what == "solve")
    return state_answer(services.ask_calibration<CalibrationState>(SolveCalibration{}), 202);
  return state_answer(services.ask_calibration<CalibrationState>(DiscardCalibration{}, kArming));
}

HttpResponse history(const Call& call) {
  Json rows = Json::array();
  auto ledger = call.services.ledger();
  if (!ledger && ledger.error().code != ErrorCode::NotFound) return error_answer(ledger.error());
  if (ledger) {
    const auto accepted = ledger->calibrations();
    if (!accepted) return error_answer(accepted.error());
    for (const Calibration& calibration : *accepted) rows.push_back(Json::parse(json_text(calibration)));
  }
  return json_answer({{"calibrations", std::move(rows)}});
}

}  // namespace

std::optional<HttpResponse> answer_calibration(const Call& call) {
  const auto& parts = call.parts;
  const bool is_get = call.request.method == "GET";
  if (is_get && parts.size() == 1 && parts[0] == "calibrations") return history(call);
  if (parts[0] != "calibration" || parts.size() > 2) return std::nullopt;
  if (is_get && parts.size() == 1) return current(call);
  if (is_get && parts[1] == "rig") return found_rig(call);
  if (call.request.method == "POST" && parts.size() == 2) return command(call, parts[1]);
  return std::nullopt;
}

}  // namespace flamefield
