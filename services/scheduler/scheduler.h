#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <vector>

#include "proto/message.h"
#include "services/ledger/query.h"

namespace flamefield {

// What becomes of a schedule at a moment.
struct ScheduleDecision {
  enum class Act { Wait, Run, Missed, Overlapped };
  Act act = Act::Wait;
  std::int64_t due_ns = 0;  // Wait: when to look again; else the time that is dealt with
  std::int64_t times = 0;   // due times up to that, which one run stands for
};

// The service was down, or asleep, when it comes later than this.
inline constexpr std::int64_t kLate_ns = 300'000'000'000;

// `jobs_left`: of its last runs. InvalidInput: its cron expression or zone is not one.
Result<ScheduleDecision> decide(const Schedule& schedule, std::int64_t jobs_left, std::int64_t now_ns);

struct SchedulerClock {
  std::function<std::int64_t()> now_ns;  // UTC
  // Returns at `until_ns`, or earlier, and as soon as a stop is asked for.
  std::function<void(std::int64_t until_ns, std::stop_token stop)> wait;
};
SchedulerClock system_clock_of_scheduler();

// What the scheduler knows of the world and does to it.
struct SchedulerDesk {
  std::function<Result<std::vector<ScheduleRow>>()> schedules;
  std::function<Result<Submitted>(const ReprocessOrder&)> launch;
  std::function<Result<>(const ScheduleRan&)> record;
};

// Does what schedules say when they say it. What was due while nothing ran is dealt with at start. A crash
// between launch and record launches again; identical work is then skipped.
class Scheduler {
 public:
  Scheduler(SchedulerDesk desk, SchedulerClock clock) : desk_(std::move(desk)), clock_(std::move(clock)) {}

  Result<> run(std::stop_token stop);

  // Deals with everything that is due now; returns when to look again, at most half a minute from now.
  std::int64_t look();

 private:
  void deal_with(const Schedule& schedule, const ScheduleDecision& decision, std::int64_t now_ns);

  SchedulerDesk desk_;
  SchedulerClock clock_;
};

}  // namespace flamefield
