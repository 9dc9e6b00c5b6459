// GET captures, captures/ID/receipt, captures/ID/sets, captures/ID/sets/INDEX, .../frames/CAMERA
#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>

#include "services/api/call.h"
#include "services/api/frame_messages.h"
#include "services/api/records_json.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;

Result<Json> captures_json(LedgerReader& ledger) {
  auto captures = ledger.captures();
  if (!captures) return tl::unexpected(captures.error());
  Json rows = Json::array();
  for (auto row = captures->rbegin(); row != captures->rend(); ++row) rows.push_back(json_of(*row));
  return Json{{"captures", std::move(rows)}};
}

Result<Json> sets_json(LedgerReader& ledger, const std::string& capture) {
  const auto sets = ledger.sets(capture);
  if (!sets) return tl::unexpected(sets.error());
  Json rows = Json::array();
  for (const SetRow& row : *sets) {
    rows.push_back(
        {{"index", row.id.index},
         {"pulse", row.pulse},
         {"pulse_time", utc_text(row.pulse_time_ns)},
         {"frames", row.frames},
         {"losses", row.losses},
         {"assembled_after_s", 1e-9 * static_cast<double>(row.complete_time_ns - row.pulse_time_ns)},
         {"stored_after_s", 1e-9 * static_cast<double>(row.stored_time_ns - row.pulse_time_ns)}});
  }
  return Json{{"capture", capture}, {"sets", std::move(rows)}};
}

HttpResponse set_answer(const Call& call) {
  std::int64_t index = -1;
  const std::string& text = call.parts[3];
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
  if (error != std::errc() || end != text.data() + text.size() || index < 0)
    return json_error(400, "sets are numbered from 0");
  const auto data = call.services.ask_dispatcher<SetData>(FetchSet{{call.parts[1], index}});
  if (!data) return error_answer(data.error());
  constexpr int kSmall_px = 320;
  if (call.parts.size() == 4)
    return binary_answer(thumbnails_message(data->set, kSmall_px), "application/octet-stream", true);
  const auto frame = std::ranges::find(data->set.frames, call.parts[5], &Frame::camera);
  if (frame == data->set.frames.end()) return json_error(404, "this camera has no frame in this set");
  auto message = frame_message(data->set, *frame);
  if (!message) return error_answer(message.error());
  return binary_answer(std::move(*message), "application/octet-stream", true);
}

}  // namespace

std::optional<HttpResponse> answer_captures(const Call& call) {
  const auto& parts = call.parts;
  if (call.request.method != "GET" || parts[0] != "captures") return std::nullopt;
  const bool is_set = parts.size() >= 4 && parts[2] == "sets";
  if (is_set && (parts.size() == 4 || (parts.size() == 6 && parts[4] == "frames"))) return set_answer(call);
  auto ledger = call.services.ledger();
  if (!ledger) {
    if (parts.size() == 1 && ledger.error().code == ErrorCode::NotFound)
      return json_answer({{"captures", Json::array()}});
    return error_answer(ledger.error());
  }
  Result<Json> json;
  if (parts.size() == 1) {
    json = captures_json(*ledger);
  } else if (parts.size() == 3 && parts[2] == "sets") {
    json = sets_json(*ledger, parts[1]);
  } else if (parts.size() == 3 && parts[2] == "receipt") {
    const auto receipt = ledger->receipt(parts[1]);
    json = receipt ? Result<Json>(json_of(*receipt)) : tl::unexpected(receipt.error());
  } else {
    return std::nullopt;
  }
  return json ? json_answer(*json) : error_answer(json.error());
}

}  // namespace flamefield
