// The dispatcher's part on orders, on control of what waits, and on questions about it.
#include "proto/utc.h"
#include "proto/version.h"
#include "services/dispatcher/desk.h"
#include "services/dispatcher/orders.h"

namespace flamefield {

Result<> Dispatcher::Impl::place(const Submit& submit, Submitted& answer) {
  auto placed = place_order(ledger, submit, utc_now_ns());
  if (!placed) return tl::unexpected(placed.error());
  for (const QueuedJob& job : placed->jobs) enqueue(job);
  answer = std::move(placed->answer);
  return {};
}

Result<Message> Dispatcher::Impl::on(PutRig& m, const Sender&) {
  auto id = ledger.put_rig(m.rig, utc_now_ns());
  if (!id) return tl::unexpected(id.error());
  return RigStored{*id};
}

Result<Message> Dispatcher::Impl::on(PutCalibration& m, const Sender&) {
  const auto stored = ledger.put_calibration(m, utc_now_ns());
  if (!stored) return tl::unexpected(stored.error());
  tell("calibration-accepted", stored->rig_id,
       concat("version ", stored->version, ", ", m.calibration.verdict, ", ", m.calibration.volume_mean_px,
              " px in the measuring volume, by ", m.calibration.accepted_by,
              "; volumes made with another one are stale"),
       true);
  return *stored;
}

Result<Message> Dispatcher::Impl::on(LivePlan& m, const Sender&) {
  if (m.on) {
    if (auto ok = check_processing(ledger, m.processing); !ok) return tl::unexpected(ok.error());
  }
  if (auto ok = ledger.put_live_plan(m); !ok) return tl::unexpected(ok.error());
  plan = m;
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(Submit& m, const Sender&) {
  Submitted answer;
  if (auto ok = place(m, answer); !ok) return tl::unexpected(ok.error());
  return answer;
}

Result<Message> Dispatcher::Impl::on(PutMetrics& m, const Sender&) {
  if (auto ok = ledger.put_metrics(m); !ok) return tl::unexpected(ok.error());
  return Accepted{};
}

Result<Message> Dispatcher::Impl::on(ControlJobs& m, const Sender&) {
  const auto changed = ledger.control(m);
  if (!changed) return tl::unexpected(changed.error());
  const bool holds_all = m.all && (m.action == JobAction::Pause || m.action == JobAction::Resume);
  if (holds_all) {
    if (auto ok = ledger.pause_all(m.action == JobAction::Pause); !ok) return tl::unexpected(ok.error());
  }
  // From here on nothing fails but the disk, after which memory is made anew.
  if (holds_all) queue.pause_all(m.action == JobAction::Pause);
  for (const ControlledJob& job : *changed) {
    if (m.action == JobAction::Retry) {
      const auto waiting = ledger.queued_job(job.id);
      if (!waiting) return tl::unexpected(waiting.error());
      if (*waiting) enqueue(**waiting);
    } else if (m.action == JobAction::Cancel) {
      queue.remove(job.id);
      if (const auto peer = roster.holder_of(job.token)) letters.push_back({*peer, 0, LeaseLost{job.token}});
      roster.end(job.token);
    } else {
      queue.pause(job.id, m.action == JobAction::Pause);
    }
  }
  const auto count = static_cast<std::int64_t>(changed->size());
  tell(concat("jobs-", name_of(m.action)), m.all ? "all" : "some", concat(count, " jobs"), true);
  return JobsControlled{count, std::max<std::int64_t>(0, static_cast<std::int64_t>(m.jobs.size()) - count)};
}

std::string Dispatcher::Impl::why(std::int64_t job_id, const std::string& last_failure) const {
  const std::int64_t now = steady_ns();
  const auto end = queue.back_off_end(job_id, now);
  std::string text = queue.why(job_id, roster.candidates(), now);
  if (end && text == "back-off") text += " until " + utc_text(utc_now_ns() + *end - now);
  if (!last_failure.empty()) text += ", after: " + last_failure;
  return text;
}

Result<Message> Dispatcher::Impl::on(GetJobs& m, const Sender&) {
  auto rows = ledger.jobs(m);
  if (!rows) return tl::unexpected(rows.error());
  for (Jobs::Row& row : *rows) {
    if (row.state == JobState::Queued) row.why = why(row.id, row.why);
  }
  return Jobs{std::move(*rows)};
}

Result<Message> Dispatcher::Impl::on(GetStatus&, const Sender&) {
  auto status = ledger.status();
  if (!status) return tl::unexpected(status.error());
  status->program_version = program_version();
  status->workers = roster.status(Clock::now());
  status->counters = counters;
  status->counters.merge(bus.counters());
  status->paused = queue.paused_all();
  for (const Priority priority : {Priority::Live, Priority::Interactive, Priority::Scheduled})
    status->queued_by_priority[std::string(name_of(priority))] = queue.size(priority);
  constexpr std::int64_t kShown = 20;
  for (const std::int64_t id : queue.first(kShown)) {
    const auto reason = ledger.reason_of(id);
    if (!reason) return tl::unexpected(reason.error());
    status->waiting.push_back({id, why(id, *reason)});
  }
  return std::move(*status);
}

}  // namespace flamefield
