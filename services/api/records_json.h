#pragma once

#include <nlohmann/json_fwd.hpp>

#include "proto/capture.h"
#include "proto/message.h"
#include "proto/rig.h"
#include "proto/utc.h"
#include "services/ledger/query.h"
#include "services/ledger/reader.h"

// Records as people and pages read them. Used by the command line and the gateway alike.
namespace flamefield {

nlohmann::ordered_json json_of(const RunRow& row);  // without its history
nlohmann::ordered_json json_of(const std::vector<HistoryPoint>& history);
nlohmann::ordered_json json_of(const WorkRow& row);
nlohmann::ordered_json json_of(const Receipt& receipt);
nlohmann::ordered_json json_of(const CaptureRow& row);
nlohmann::ordered_json json_of(const CaptureState& state);
nlohmann::ordered_json json_of(const Status& status);
nlohmann::ordered_json json_of(const Rig& rig, const std::string& id);

}  // namespace flamefield
