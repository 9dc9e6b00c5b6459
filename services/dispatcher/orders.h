#pragma once

#include <cstdint>

#include "proto/message.h"
#include "services/ledger/ledger.h"

namespace flamefield {

// Turns what was asked for into jobs of the ledger. Call inside a transaction.
// NotFound: unknown rig, capture, set or reference capture. InvalidInput: nothing asked for.
struct PlacedOrder {
  Submitted answer;
  std::vector<QueuedJob> jobs;  // new ones
};
Result<PlacedOrder> place_order(Ledger& ledger, const Submit& submit, std::int64_t now_ns);

// A LivePlan is checked when it comes, so that it cannot fail later, set by set.
Result<> check_processing(Ledger& ledger, const Processing& processing);

}  // namespace flamefield
