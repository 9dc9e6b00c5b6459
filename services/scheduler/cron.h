#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "proto/error.h"

namespace date {
class time_zone;
}

namespace flamefield {

// A zone of the IANA database, as the system has it.
class TimeZone {
 public:
  static Result<TimeZone> find(const std::string& name);  // InvalidInput: no such zone, or no database
  const date::time_zone& zone() const { return *zone_; }

 private:
  explicit TimeZone(const date::time_zone* zone) : zone_(zone) {}
  const date::time_zone* zone_;
};

// When something is due, as crontab(5) has it: minute hour day-of-month month day-of-week, each "*", a
// number, a list, a range, or a step; months and days also by name; 7 is Sunday too. When both days are
// restricted, either will do. Also @hourly @daily @weekly @monthly @yearly.
//
// Where clocks change: a time of day that is left out comes at the moment of the change; one that comes twice
// counts the first time. With "*" as the hour it is simply every such minute that passes. (As in Vixie's
// cron.)
class Cron {
 public:
  static Result<Cron> parse(std::string_view text);  // InvalidInput: names the field; or it never comes

  // The first due time after `after_ns`, both UTC; none within twelve years.
  std::optional<std::int64_t> next(std::int64_t after_ns, const TimeZone& zone) const;

 private:
  Cron() = default;
  std::bitset<60> minutes_;
  std::bitset<24> hours_;
  std::bitset<32> days_;     // 1 to 31
  std::bitset<13> months_;   // 1 to 12
  std::bitset<7> weekdays_;  // 0: Sunday
  bool every_hour_ = false;  // "*" or "*/n"
  bool any_day_ = false, any_weekday_ = false;
};

}  // namespace flamefield
