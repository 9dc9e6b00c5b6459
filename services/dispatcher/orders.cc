#include "services/dispatcher/orders.h"

#include <set>

#include "proto/version.h"
#include "services/dispatcher/cost_model.h"

namespace flamefield {

namespace {

Result<std::vector<SetId>> asked_sets(Ledger& ledger, const Submit& submit) {
  std::set<SetId> ids(submit.sets.begin(), submit.sets.end());
  for (const std::string& capture : submit.captures) {
    const auto sets = ledger.sets_of(capture);
    if (!sets) return tl::unexpected(sets.error());
    if (sets->empty())
      return not_found(concat("capture ", capture), "it has no stored sets", "see 'flamefield runs receipt'");
    ids.insert(sets->begin(), sets->end());
  }
  if (ids.empty())
    return invalid_input("nothing to reconstruct", "no capture and no set was named", "name a capture");
  return std::vector<SetId>(ids.begin(), ids.end());
}

Result<> add(Ledger& ledger, Job job, double work, PlacedOrder& order) {
  job.program_version = program_version();
  job.run_id = run_id_of(job);
  const auto id = ledger.add_job(job, work);
  if (!id) return tl::unexpected(id.error());
  order.answer.run_ids.push_back(job.run_id);
  if (!*id) {
    ++order.answer.identical;
    return {};
  }
  order.answer.job_ids.push_back(**id);
  QueuedJob queued{.id = **id, .priority = job.priority, .share = share_of(job)};
  queued.setup = setup_of(job.processing);
  queued.solver = job.processing.recipe.solver;
  queued.work = work;
  order.jobs.push_back(std::move(queued));
  return {};
}

}  // namespace

Result<> check_processing(Ledger& ledger, const Processing& processing) {
  if (const auto rig = ledger.rig(processing.rig_id); !rig) return tl::unexpected(rig.error());
  for (const std::string& capture :
       {processing.dark_capture, processing.background_capture, processing.flat_capture}) {
    if (capture.empty()) continue;
    const auto sets = ledger.sets_of(capture);
    if (!sets) return tl::unexpected(sets.error());
    if (sets->empty())
      return not_found(concat("reference capture ", capture), "it has no stored sets", "capture it first");
  }
  return {};
}

Result<PlacedOrder> place_order(Ledger& ledger, const Submit& submit, std::int64_t now_ns) {
  if (auto ok = check_processing(ledger, submit.processing); !ok) return tl::unexpected(ok.error());
  const auto sets = asked_sets(ledger, submit);
  if (!sets) return tl::unexpected(sets.error());
  const auto rig = ledger.rig(submit.processing.rig_id);
  if (!rig) return tl::unexpected(rig.error());
  const auto submission = ledger.next_submission();
  if (!submission) return tl::unexpected(submission.error());
  Job job;
  job.processing = submit.processing;
  job.priority = submit.priority;
  job.created_time_ns = now_ns;
  job.submitter = submit.submitter;
  job.submission = *submission;
  const double work = work_of(job.processing.grid, rig->cameras.size());
  PlacedOrder order;
  order.answer.submission = *submission;
  if (submit.combine == Combine::Mean) {
    job.inputs = *sets;
    if (auto ok = add(ledger, job, work, order); !ok) return tl::unexpected(ok.error());
    return order;
  }
  for (const SetId& set : *sets) {
    job.inputs = {set};
    if (auto ok = add(ledger, job, work, order); !ok) return tl::unexpected(ok.error());
  }
  return order;
}

}  // namespace flamefield
