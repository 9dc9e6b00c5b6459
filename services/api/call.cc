#include "services/api/call.h"

#include <charconv>
#include <nlohmann/json.hpp>

namespace flamefield {

std::string Call::query(const std::string& name) const {
  return query_value(request.query, name).value_or("");
}

Result<std::int64_t> Call::number(const std::string& name, std::int64_t fallback, std::int64_t low,
                                  std::int64_t high) const {
  const std::string text = query(name);
  if (text.empty()) return fallback;
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high) {
    return invalid_input(concat(name, "=", text),
                         concat("it must be a whole number from ", low, " to ", high),
                         "leave it out for the default");
  }
  return value;
}

Result<nlohmann::json> Call::body() const {
  auto json = nlohmann::json::parse(request.body, nullptr, false);
  if (!json.is_object())
    return invalid_input("the request's body", "it is not a JSON object", "see /api/v1/openapi.json");
  return json;
}

HttpResponse json_answer(const nlohmann::ordered_json& json, int status) {
  return {.status = status,
          .content_type = "application/json",
          .body = json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace),
          .file = {},
          .headers = {}};
}

HttpResponse binary_answer(std::string bytes, const char* content_type, bool never_changes) {
  HttpResponse response{
      .status = 200, .content_type = content_type, .body = std::move(bytes), .file = {}, .headers = {}};
  if (never_changes) response.headers["Cache-Control"] = "private, max-age=86400, immutable";
  return response;
}

HttpResponse error_answer(const Error& error) {
  switch (error.code) {
    case ErrorCode::InvalidInput:
      return json_error(400, error.message);
    case ErrorCode::NotFound:
      return json_error(404, error.message);
    case ErrorCode::Unavailable:
      return json_error(503, error.message);
    case ErrorCode::DataLoss:
      break;
  }
  return json_error(500, error.message);
}

}  // namespace flamefield
