#pragma once

#include <optional>
#include <string>

#include "proto/capture.h"
#include "proto/message.h"
#include "services/api/machine_figures.h"
#include "services/ledger/figures.h"

namespace flamefield {

// The array's and the dispatcher's counters in the text format of Prometheus (exposition format 0.0.4). What
// is not known is left out. Counters of a capture begin again with each capture.
std::string prometheus_text(const std::optional<CaptureState>& array, const std::optional<Status>& status);

// Queues and latencies out of the ledger, and the state of the machine; latencies are quantiles of the newest
// rows.
std::string prometheus_text(const std::optional<LedgerFigures>& ledger, const MachineFigures& machine);

}  // namespace flamefield
