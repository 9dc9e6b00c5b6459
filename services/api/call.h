#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "services/api/live_services.h"
#include "services/gateway/gateway.h"

namespace flamefield {

// One request below /api/v1/, taken apart.
struct Call {
  LiveServices& services;
  const HttpRequest& request;
  std::vector<std::string> parts;  // of the path: {"runs", "ID", "volume"}

  std::string query(const std::string& name) const;  // empty: not given
  // InvalidInput: no whole number, or outside of [low, high].
  Result<std::int64_t> number(const std::string& name, std::int64_t fallback, std::int64_t low,
                              std::int64_t high) const;
  Result<nlohmann::json> body() const;  // InvalidInput: no JSON object
};

HttpResponse json_answer(const nlohmann::ordered_json& json, int status = 200);
HttpResponse binary_answer(std::string bytes, const char* content_type, bool never_changes);
// 400 for InvalidInput, 404 NotFound, 503 Unavailable, 500 DataLoss: {"error": "<problem> (<why>)
// <suggestion>"}.
HttpResponse error_answer(const Error& error);

// The routes. none: there is no such thing.
std::optional<HttpResponse> answer_runs(const Call& call);         // runs...
std::optional<HttpResponse> answer_captures(const Call& call);     // captures...
std::optional<HttpResponse> answer_recipes(const Call& call);      // solvers, recipes...
std::optional<HttpResponse> answer_array(const Call& call);        // capture, capture/stop
std::optional<HttpResponse> answer_work(const Call& call);         // jobs, reprocess...
std::optional<HttpResponse> answer_records(const Call& call);      // events, rigs/ID
std::optional<HttpResponse> answer_calibration(const Call& call);  // calibration..., calibrations

}  // namespace flamefield
