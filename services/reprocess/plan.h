#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "proto/message.h"
#include "services/config/recipe_file.h"
#include "services/ledger/query.h"

namespace flamefield {

// What an order comes to, before anything is submitted.
struct ReprocessPlan {
  std::vector<Submit> orders;          // of work that is not there yet
  std::int64_t asked = 0;              // volumes that the order names
  std::vector<std::string> identical;  // runs of these that are done, running or waiting already
  std::int64_t past_runs = 0;          // recorded runs that the estimate rests on
  double seconds = 0;                  // of one worker; meaningless without past runs
  double peak_rss_mib = 0;             // of a worker
  std::int64_t volumes() const { return asked - static_cast<std::int64_t>(identical.size()); }
};

// Selects by the filter. One that names fields of runs selects recorded work and repeats it, each as it was;
// one that names only fields of sets selects sets of bursts and live captures, done like the newest run. Then
// lays the changes over: rig, recipe (settings of [prepare] that it does not name stay: they belong to the
// recording), single settings, sweeps. `now_ns`: for times like -2h. InvalidInput: filter or recipe;
// NotFound: nothing to start from.
Result<ReprocessPlan> plan_reprocessing(LedgerQuery& ledger, const ReprocessOrder& order,
                                        const RecipeCheck& check, std::int64_t now_ns);

// The same changes for runs that were picked one by one; the order's filter and `stale` do not count.
// NotFound: there is no such run.
Result<ReprocessPlan> plan_reprocessing(LedgerQuery& ledger, const std::vector<std::string>& run_ids,
                                        const ReprocessOrder& order, const RecipeCheck& check);

// The same plan with its first new volume only, ahead of other reprocessing.
ReprocessPlan preview_of(const ReprocessPlan& plan);

// Sends the orders through `ask`; sums up the answers. The runs that are there already come last.
Result<Submitted> submit_plan(const ReprocessPlan& plan,
                              const std::function<Result<Submitted>(const Submit&)>& ask);

}  // namespace flamefield
