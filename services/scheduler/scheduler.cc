#include "services/scheduler/scheduler.h"

#include <algorithm>
#include <condition_variable>
#include <mutex>

#include "proto/utc.h"
#include "services/log/log.h"
#include "services/scheduler/cron.h"

namespace flamefield {

namespace {

// New schedules, and clocks that were set, are noticed after this long.
constexpr std::int64_t kLongestNap_ns = 30'000'000'000;
constexpr std::int64_t kMostTimes = 10'000;

using Act = ScheduleDecision::Act;

}  // namespace

Result<ScheduleDecision> decide(const Schedule& schedule, std::int64_t jobs_left, std::int64_t now_ns) {
  const auto cron = Cron::parse(schedule.cron);
  if (!cron) return tl::unexpected(cron.error());
  const auto zone = TimeZone::find(schedule.zone);
  if (!zone) return tl::unexpected(zone.error());
  std::int64_t after_ns = std::max(schedule.created_time_ns, schedule.last_due_ns);
  ScheduleDecision decision;
  auto due = cron->next(after_ns, *zone);
  while (due && *due <= now_ns) {
    decision.due_ns = *due;
    // After years of absence the count stops, but not the way to the newest due time.
    after_ns = ++decision.times < kMostTimes ? *due : std::max(*due, now_ns - 86'400'000'000'000);
    due = cron->next(after_ns, *zone);
  }
  if (decision.times == 0) {
    decision.due_ns = due.value_or(now_ns + kLongestNap_ns);
    return decision;
  }
  decision.act = Act::Run;
  const bool is_late = now_ns - decision.due_ns > kLate_ns;
  if (is_late && schedule.missed == MissedRuns::Skip) decision.act = Act::Missed;
  if (decision.act == Act::Run && jobs_left > 0 && schedule.overlap == OverlapRuns::Skip)
    decision.act = Act::Overlapped;
  return decision;
}

SchedulerClock system_clock_of_scheduler() {
  return {utc_now_ns, [](std::int64_t until_ns, std::stop_token stop) {
            std::mutex mutex;
            std::condition_variable_any wake;
            std::unique_lock lock(mutex);
            const std::chrono::nanoseconds rest(std::max<std::int64_t>(0, until_ns - utc_now_ns()));
            wake.wait_for(lock, stop, rest, [] { return false; });
          }};
}

Result<> Scheduler::run(std::stop_token stop) {
  while (!stop.stop_requested()) clock_.wait(look(), stop);
  return {};
}

std::int64_t Scheduler::look() {
  const std::int64_t now_ns = clock_.now_ns();
  std::int64_t again_ns = now_ns + kLongestNap_ns;
  const auto rows = desk_.schedules();
  if (!rows) {
    if (rows.error().code != ErrorCode::NotFound)
      log_event(LogLevel::Warning, "schedules-unreadable", {{"error", rows.error().message}});
    return again_ns;
  }
  for (const ScheduleRow& row : *rows) {
    const auto decision = decide(row.schedule, row.jobs_left, now_ns);
    if (!decision) {
      log_event(LogLevel::Error, "schedule-unusable",
                {{"schedule", row.schedule.name}, {"error", decision.error().message}});
      continue;
    }
    if (decision->act == Act::Wait)
      again_ns = std::min(again_ns, decision->due_ns);
    else
      deal_with(row.schedule, *decision, now_ns);
  }
  return again_ns;
}

void Scheduler::deal_with(const Schedule& schedule, const ScheduleDecision& decision, std::int64_t now_ns) {
  ScheduleRan ran{schedule.name, decision.due_ns, now_ns, "", "", {}};
  const std::string_view at_least = decision.times >= kMostTimes ? "at least " : "";
  const std::string more =
      decision.times > 1 ? concat("; stands for ", at_least, decision.times, " due times") : "";
  if (decision.act == Act::Missed) {
    ran.outcome = "missed";
    ran.text = concat("the service was not running", more);
  } else if (decision.act == Act::Overlapped) {
    ran.outcome = "overlapped";
    ran.text = concat("jobs of the last run are not done", more);
  } else {
    auto submitted = desk_.launch(schedule.order);
    if (!submitted && submitted.error().code == ErrorCode::Unavailable) {
      log_event(LogLevel::Warning, "schedule-put-off",
                {{"schedule", schedule.name}, {"error", submitted.error().message}});
      return;  // tried again with the next look
    }
    ran.outcome = submitted ? "submitted" : "failed";
    ran.text = submitted
                   ? concat(submitted->job_ids.size(), " jobs, ", submitted->identical, " identical", more)
                   : submitted.error().message;
    if (submitted) ran.job_ids = std::move(submitted->job_ids);
  }
  log_event(LogLevel::Info, "schedule-ran",
            {{"schedule", ran.name}, {"outcome", ran.outcome}, {"text", ran.text}});
  if (auto ok = desk_.record(ran); !ok)
    log_event(LogLevel::Error, "schedule-not-recorded",
              {{"schedule", ran.name}, {"error", ok.error().message}});
}

}  // namespace flamefield
