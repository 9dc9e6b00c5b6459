#include "services/scheduler/scheduler.h"

#include <gtest/gtest.h>

#include <ctime>

namespace flamefield {
namespace {

using Act = ScheduleDecision::Act;

constexpr std::int64_t kMinute = 60'000'000'000;
constexpr std::int64_t kHour = 60 * kMinute;
constexpr std::int64_t kDay = 24 * kHour;
constexpr std::int64_t kMidnight = 1'772'323'200'000'000'000;  // 2026-03-01T00:00Z

Schedule hourly() {
  Schedule schedule;
  schedule.name = "hourly";
  schedule.cron = "@hourly";
  schedule.created_time_ns = kMidnight;
  return schedule;
}

TEST(Scheduler, WaitsUntilTheNextDueTime) {
  const auto decision = decide(hourly(), 0, kMidnight + kMinute);
  ASSERT_TRUE(decision);
  EXPECT_EQ(decision->act, Act::Wait);
  EXPECT_EQ(decision->due_ns, kMidnight + kHour);
}

TEST(Scheduler, RunsWhatIsDueOnceAndOnlyOnce) {
  Schedule schedule = hourly();
  const auto due = decide(schedule, 0, kMidnight + kHour);
  EXPECT_EQ(due->act, Act::Run);
  EXPECT_EQ(due->due_ns, kMidnight + kHour);
  schedule.last_due_ns = due->due_ns;
  EXPECT_EQ(decide(schedule, 0, kMidnight + kHour + kMinute)->act, Act::Wait);
}

TEST(Scheduler, MissedTimesAreOneRunOrNone) {
  Schedule schedule = hourly();
  const std::int64_t back = kMidnight + 7 * kHour + 30 * kMinute;
  const auto once = decide(schedule, 0, back);
  EXPECT_EQ(once->act, Act::Run);
  EXPECT_EQ(once->times, 7);
  EXPECT_EQ(once->due_ns, kMidnight + 7 * kHour);
  schedule.missed = MissedRuns::Skip;
  EXPECT_EQ(decide(schedule, 0, back)->act, Act::Missed);
  EXPECT_EQ(decide(schedule, 0, kMidnight + 7 * kHour + kMinute)->act, Act::Run)
      << "hardly late is not missed";
}

TEST(Scheduler, YearsOfAbsenceAreDealtWithAtOnce) {
  Schedule schedule = hourly();
  schedule.cron = "* * * * *";
  const std::int64_t back = kMidnight + 3 * 365 * kDay;
  const auto decision = decide(schedule, 0, back);
  ASSERT_TRUE(decision);
  EXPECT_EQ(decision->act, Act::Run);
  EXPECT_EQ(decision->due_ns, back);
}

TEST(Scheduler, WhileJobsAreLeftTheNextRunIsSkippedOrQueued) {
  Schedule schedule = hourly();
  EXPECT_EQ(decide(schedule, 3, kMidnight + kHour)->act, Act::Overlapped);
  schedule.overlap = OverlapRuns::Queue;
  EXPECT_EQ(decide(schedule, 3, kMidnight + kHour)->act, Act::Run);
}

TEST(Scheduler, AClockThatWasSetBackRunsNothingTwice) {
  Schedule schedule = hourly();
  schedule.last_due_ns = kMidnight + 5 * kHour;
  const auto decision = decide(schedule, 0, kMidnight + 3 * kHour);
  EXPECT_EQ(decision->act, Act::Wait);
  EXPECT_EQ(decision->due_ns, kMidnight + 6 * kHour);
}

// A desk with a clock that jumps from wait to wait.
struct Office {
  std::int64_t now_ns = kMidnight;
  ScheduleRow row{hourly(), 0, 0, "", ""};
  std::vector<ScheduleRan> records;
  int launches = 0;
  std::optional<Error> trouble;

  Scheduler open(std::int64_t until_ns, std::stop_source& stop) {
    SchedulerDesk desk;
    desk.schedules = [this]() -> Result<std::vector<ScheduleRow>> { return std::vector{row}; };
    desk.launch = [this](const ReprocessOrder&) -> Result<Submitted> {
      ++launches;
      if (trouble) return tl::unexpected(*trouble);
      Submitted submitted;
      submitted.job_ids = {1, 2};
      return submitted;
    };
    desk.record = [this](const ScheduleRan& ran) -> Result<> {
      records.push_back(ran);
      row.schedule.last_due_ns = ran.due_ns;
      return {};
    };
    SchedulerClock clock{[this] { return now_ns; },
                         [this, until_ns, &stop](std::int64_t wake_ns, std::stop_token) {
                           now_ns = std::max(now_ns + 1, wake_ns);
                           if (now_ns > until_ns) stop.request_stop();
                         }};
    return Scheduler(std::move(desk), std::move(clock));
  }
};

TEST(Scheduler, ADayOfHoursIsTwentyFourRuns) {
  Office office;
  std::stop_source stop;
  Scheduler scheduler = office.open(kMidnight + kDay + kMinute, stop);
  ASSERT_TRUE(scheduler.run(stop.get_token()));
  ASSERT_EQ(office.records.size(), 24u);
  for (std::size_t i = 0; i < 24; ++i) {
    EXPECT_EQ(office.records[i].due_ns, kMidnight + static_cast<std::int64_t>(i + 1) * kHour);
    EXPECT_EQ(office.records[i].outcome, "submitted");
    EXPECT_EQ(office.records[i].job_ids.size(), 2u);
  }
}

TEST(Scheduler, WhatCannotBeSubmittedNowIsTriedAgainAndWhatIsWrongIsRecorded) {
  Office office;
  office.now_ns = kMidnight + kHour;
  office.trouble = Error{ErrorCode::Unavailable, "no answer"};
  std::stop_source stop;
  Scheduler scheduler = office.open(kMidnight + kDay, stop);
  scheduler.look();
  scheduler.look();
  EXPECT_EQ(office.launches, 2);
  EXPECT_TRUE(office.records.empty());
  office.trouble = Error{ErrorCode::InvalidInput, "no such field"};
  scheduler.look();
  ASSERT_EQ(office.records.size(), 1u);
  EXPECT_EQ(office.records[0].outcome, "failed");
  EXPECT_EQ(office.records[0].text, "no such field");
}

}  // namespace
}  // namespace flamefield
