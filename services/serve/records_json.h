#pragma once

#include <nlohmann/json_fwd.hpp>

#include "proto/capture.h"
#include "proto/message.h"
#include "services/ledger/reader.h"

// Records as people and pages read them. Used by the command line and the gateway alike.
namespace flamefield {

nlohmann::ordered_json json_of(const RunRow& row);  // without its history
nlohmann::ordered_json json_of(const std::vector<HistoryPoint>& history);
nlohmann::ordered_json json_of(const Receipt& receipt);
nlohmann::ordered_json json_of(const CaptureRow& row);
nlohmann::ordered_json json_of(const CaptureState& state);
nlohmann::ordered_json json_of(const Status& status);

// "2026-03-01T10:15:00.123Z"; empty for 0.
std::string utc_text(std::int64_t time_ns);

}  // namespace flamefield
