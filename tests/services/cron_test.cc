#include "services/scheduler/cron.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <ctime>
#include <random>

namespace flamefield {
namespace {

// "2026-03-29T01:00" UTC -> ns
std::int64_t utc(const std::string& text) {
  std::tm tm{};
  EXPECT_NE(::strptime(text.c_str(), "%Y-%m-%dT%H:%M", &tm), nullptr);
  return static_cast<std::int64_t>(::timegm(&tm)) * 1'000'000'000;
}

std::string text_of(std::optional<std::int64_t> time_ns) {
  if (!time_ns) return "never";
  const std::time_t seconds = *time_ns / 1'000'000'000;
  std::tm tm{};
  ::gmtime_r(&seconds, &tm);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M", &tm);
  return text;
}

// The first few due times after a moment.
std::vector<std::string> dues(const std::string& cron, const std::string& zone, const std::string& after,
                              int count) {
  const auto parsed = Cron::parse(cron);
  EXPECT_TRUE(parsed) << parsed.error().message;
  const auto in = TimeZone::find(zone);
  EXPECT_TRUE(in) << in.error().message;
  std::vector<std::string> out;
  std::int64_t at = utc(after);
  for (int i = 0; i < count; ++i) {
    const auto next = parsed->next(at, *in);
    out.push_back(text_of(next));
    if (!next) break;
    at = *next;
  }
  return out;
}

using Times = std::vector<std::string>;

TEST(Cron, FieldsListsRangesStepsAndNames) {
  EXPECT_EQ(dues("*/15 8-9 * * *", "UTC", "2026-01-01T08:40", 3),
            (Times{"2026-01-01T08:45", "2026-01-01T09:00", "2026-01-01T09:15"}));
  EXPECT_EQ(dues("0 6,18 * * mon-fri", "UTC", "2026-01-02T18:00", 2),  // a Friday evening
            (Times{"2026-01-05T06:00", "2026-01-05T18:00"}));
  EXPECT_EQ(dues("30 2 29 feb *", "UTC", "2026-01-01T00:00", 2),
            (Times{"2028-02-29T02:30", "2032-02-29T02:30"}));
  EXPECT_EQ(dues("@weekly", "UTC", "2026-01-01T00:00", 1), (Times{"2026-01-04T00:00"}));
  EXPECT_EQ(dues("0 0 * * 7", "UTC", "2026-01-01T00:00", 1), (Times{"2026-01-04T00:00"}));
  EXPECT_EQ(dues("5/20 0 1 1 *", "UTC", "2026-01-01T00:00", 2),
            (Times{"2026-01-01T00:05", "2026-01-01T00:25"}));
}

// crontab(5): "if both fields are restricted, the command will be run when either field matches".
TEST(Cron, EitherDayWillDoWhenBothAreRestricted) {
  EXPECT_EQ(dues("0 0 13 * fri", "UTC", "2026-01-01T00:00", 3),
            (Times{"2026-01-02T00:00", "2026-01-09T00:00", "2026-01-13T00:00"}));
}

// Vienna, 29 March 2026: 02:00 CET becomes 03:00 CEST at 01:00 UTC.
TEST(Cron, ATimeThatTheClockLeavesOutComesAtTheChange) {
  EXPECT_EQ(dues("30 2 * * *", "Europe/Vienna", "2026-03-28T00:00", 3),
            (Times{"2026-03-28T01:30", "2026-03-29T01:00", "2026-03-30T00:30"}));
  EXPECT_EQ(dues("0,30 2 * * *", "Europe/Vienna", "2026-03-28T12:00", 2),
            (Times{"2026-03-29T01:00", "2026-03-30T00:00"}))
      << "both left-out times are one";
}

// 25 October 2026: 03:00 CEST becomes 02:00 CET at 01:00 UTC.
TEST(Cron, ATimeThatComesTwiceCountsOnce) {
  EXPECT_EQ(dues("30 2 * * *", "Europe/Vienna", "2026-10-24T12:00", 2),
            (Times{"2026-10-25T00:30", "2026-10-26T01:30"}));
}

TEST(Cron, EveryHourIsEveryHourThatPasses) {
  EXPECT_EQ(dues("30 * * * *", "Europe/Vienna", "2026-03-29T00:00", 3),
            (Times{"2026-03-29T00:30", "2026-03-29T01:30", "2026-03-29T02:30"}));
  EXPECT_EQ(dues("30 * * * *", "Europe/Vienna", "2026-10-25T00:00", 3),
            (Times{"2026-10-25T00:30", "2026-10-25T01:30", "2026-10-25T02:30"}));
}

// Lord Howe Island moves by half an hour; Samoa left out 30 December 2011; Tokyo does neither.
TEST(Cron, KnowsOddZones) {
  EXPECT_EQ(dues("15 2 * * *", "Australia/Lord_Howe", "2026-10-03T00:00", 2),
            (Times{"2026-10-03T15:30", "2026-10-04T15:15"}));
  EXPECT_EQ(dues("0 12 * * *", "Pacific/Apia", "2011-12-29T00:00", 3),
            (Times{"2011-12-29T22:00", "2011-12-30T10:00", "2011-12-30T22:00"}));
  EXPECT_EQ(dues("0 9 * * *", "Asia/Tokyo", "2026-03-28T12:00", 2),
            (Times{"2026-03-29T00:00", "2026-03-30T00:00"}));
}

// The C library's own reading of the zone, minute by minute, against ours.
TEST(Cron, AgreesWithWalkingThroughEveryMinute) {
  std::mt19937 random(7);
  for (const char* zone : {"Europe/Vienna", "America/St_Johns", "Asia/Kathmandu"}) {
    ::setenv("TZ", zone, 1);
    ::tzset();
    for (int n = 0; n < 6; ++n) {
      const int minute = static_cast<int>(random() % 60), step = 1 + static_cast<int>(random() % 5);
      const int weekday = static_cast<int>(random() % 7);
      const auto cron = Cron::parse(concat(minute, " */", step, " * * ", weekday));
      ASSERT_TRUE(cron);
      std::int64_t at = utc(n % 2 ? "2026-03-20T00:00" : "2026-10-20T00:00");
      const auto in = TimeZone::find(zone).value();
      for (int i = 0; i < 20; ++i) {
        std::time_t walk = at / 1'000'000'000;
        std::tm tm{};
        do {
          walk += 60;
          ::localtime_r(&walk, &tm);
        } while (tm.tm_min != minute || tm.tm_hour % step != 0 || tm.tm_wday != weekday);
        at = cron->next(at, in).value();
        ASSERT_EQ(text_of(at), text_of(static_cast<std::int64_t>(walk) * 1'000'000'000))
            << zone << " " << minute << " */" << step << " * * " << weekday;
      }
    }
  }
  ::unsetenv("TZ");
  ::tzset();
}

TEST(Cron, FaultsNameTheirField) {
  const auto fault = [](const char* text) {
    const auto cron = Cron::parse(text);
    return cron ? std::string("accepted") : cron.error().message;
  };
  EXPECT_NE(fault("61 * * * *").find("minute '61'"), std::string::npos) << fault("61 * * * *");
  EXPECT_NE(fault("* 24 * * *").find("hour"), std::string::npos);
  EXPECT_NE(fault("* * 0 * *").find("day of month"), std::string::npos);
  EXPECT_NE(fault("* * * foo *").find("month 'foo'"), std::string::npos);
  EXPECT_NE(fault("* * * * 8").find("day of week"), std::string::npos);
  EXPECT_NE(fault("*/0 * * * *").find("step"), std::string::npos);
  EXPECT_NE(fault("5-1 * * * *").find("ends before"), std::string::npos);
  EXPECT_NE(fault("* * * *").find("4 fields"), std::string::npos);
  EXPECT_NE(fault("0 0 30 2 *").find("no year"), std::string::npos);
  EXPECT_NE(fault(""), "accepted");
  EXPECT_FALSE(TimeZone::find("Europe/Atlantis"));
  EXPECT_FALSE(TimeZone::find("../../etc/passwd"));
}

}  // namespace
}  // namespace flamefield
