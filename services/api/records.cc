// GET events, rigs/ID
#include <nlohmann/json.hpp>

#include "services/api/call.h"
#include "services/api/records_json.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;

Result<Json> events_json(LedgerReader& ledger, std::int64_t limit) {
  const auto events = ledger.events(limit);
  if (!events) return tl::unexpected(events.error());
  Json rows = Json::array();
  for (const Event& event : *events)
    rows.push_back({{"time", utc_text(event.time_ns)},
                    {"kind", event.kind},
                    {"subject", event.subject},
                    {"text", event.text}});
  return Json{{"events", std::move(rows)}};
}

}  // namespace

std::optional<HttpResponse> answer_records(const Call& call) {
  const auto& parts = call.parts;
  const bool is_rig = parts.size() == 2 && parts[0] == "rigs",
             is_events = parts.size() == 1 && parts[0] == "events";
  if (call.request.method != "GET" || !(is_rig || is_events)) return std::nullopt;
  const auto limit = call.number("limit", 100, 1, 1000);
  if (!limit) return error_answer(limit.error());
  auto ledger = call.services.ledger();
  if (!ledger) {
    if (is_events && ledger.error().code == ErrorCode::NotFound)
      return json_answer({{"events", Json::array()}});
    return error_answer(ledger.error());
  }
  if (is_events) {
    const auto json = events_json(*ledger, *limit);
    return json ? json_answer(*json) : error_answer(json.error());
  }
  const auto rig = ledger->rig(parts[1]);
  return rig ? json_answer(json_of(*rig, parts[1])) : error_answer(rig.error());
}

}  // namespace flamefield
