// The only file that includes the date library: GCC 12 has no std::chrono time zones.
#include "services/scheduler/cron.h"

#include <date/tz.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <span>
#include <vector>

namespace flamefield {

namespace {

constexpr int kLongestWait_days = 12 * 366;  // 29 February may stay away for eight years

struct FieldRule {
  std::string_view name;
  int first, last;
  std::span<const std::string_view> words;  // of `first`, `first` + 1, ...
};
constexpr std::array<std::string_view, 12> kMonths = {"jan", "feb", "mar", "apr", "may", "jun",
                                                      "jul", "aug", "sep", "oct", "nov", "dec"};
constexpr std::array<std::string_view, 7> kWeekdays = {"sun", "mon", "tue", "wed", "thu", "fri", "sat"};
const std::array<FieldRule, 5> kRules = {{{"minute", 0, 59, {}},
                                          {"hour", 0, 23, {}},
                                          {"day of month", 1, 31, {}},
                                          {"month", 1, 12, kMonths},
                                          {"day of week", 0, 7, kWeekdays}}};

tl::unexpected<Error> fault(const FieldRule& rule, std::string_view text, std::string_view why) {
  return invalid_input(
      concat("cron ", rule.name, " '", text, "'"), why,
      concat("use *, numbers from ", rule.first, " to ", rule.last, ", lists 1,2, ranges 1-5 or steps */10"));
}

std::vector<std::string_view> split(std::string_view text, char at) {
  std::vector<std::string_view> parts;
  for (std::size_t end; (end = text.find(at)) != std::string_view::npos; text.remove_prefix(end + 1))
    parts.push_back(text.substr(0, end));
  parts.push_back(text);
  return parts;
}

std::optional<int> number_of(const FieldRule& rule, std::string_view text) {
  std::string lower(text);
  std::ranges::transform(lower, lower.begin(), [](unsigned char c) { return std::tolower(c); });
  const auto word = std::ranges::find(rule.words, std::string_view(lower));
  if (word != rule.words.end()) return rule.first + static_cast<int>(word - rule.words.begin());
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value >= rule.first && value <= rule.last ? std::optional(value) : std::nullopt;
}

// "*/15", "1-5", "mon", "8-18/2": sets the bits it names.
template <std::size_t Size>
Result<> add_part(const FieldRule& rule, std::string_view part, std::bitset<Size>& bits) {
  const auto halves = split(part, '/');
  int step = 1;
  if (halves.size() > 2) return fault(rule, part, "it has two steps");
  if (halves.size() == 2) {
    const auto [end, error] = std::from_chars(halves[1].data(), halves[1].data() + halves[1].size(), step);
    if (error != std::errc() || end != halves[1].data() + halves[1].size() || step < 1 || step > 60)
      return fault(rule, part, "its step is no number from 1 to 60");
  }
  int first = rule.first, last = rule.last;
  if (halves[0] != "*") {
    const auto ends = split(halves[0], '-');
    const auto low = number_of(rule, ends[0]);
    const auto high = ends.size() == 2 ? number_of(rule, ends[1]) : low;
    if (!low || !high || ends.size() > 2) return fault(rule, part, "it names nothing there");
    if (*low > *high) return fault(rule, part, "it ends before it begins");
    first = *low;
    last = ends.size() == 1 && halves.size() == 2 ? rule.last : *high;
  }
  for (int i = first; i <= last; i += step)
    bits.set(static_cast<std::size_t>(Size == 7 ? i % 7 : i));  // 7 is Sunday, as 0 is
  return {};
}

template <std::size_t Size>
Result<> add_field(const FieldRule& rule, std::string_view field, std::bitset<Size>& bits) {
  for (std::string_view part : split(field, ',')) {
    if (auto ok = add_part(rule, part, bits); !ok) return ok;
  }
  return {};
}

std::string_view unabbreviated(std::string_view text) {
  static constexpr std::pair<std::string_view, std::string_view> kShort[] = {
      {"@hourly", "0 * * * *"},  {"@daily", "0 0 * * *"},   {"@midnight", "0 0 * * *"},
      {"@weekly", "0 0 * * 0"},  {"@monthly", "0 0 1 * *"}, {"@yearly", "0 0 1 1 *"},
      {"@annually", "0 0 1 1 *"}};
  for (const auto& [name, meaning] : kShort) {
    if (text == name) return meaning;
  }
  return text;
}

std::vector<std::string_view> words_of(std::string_view text) {
  std::vector<std::string_view> words;
  for (std::string_view word : split(text, ' ')) {
    if (!word.empty()) words.push_back(word);
  }
  return words;
}

}  // namespace

Result<TimeZone> TimeZone::find(const std::string& name) {
  try {
    return TimeZone(date::locate_zone(name));
  } catch (const std::exception& problem) {
    return invalid_input(concat("time zone '", name, "'"),
                         "the system's time zone database has none of this name",
                         "use e.g. UTC, Asia/Tokyo or Europe/Vienna; see /usr/share/zoneinfo");
  }
}

Result<Cron> Cron::parse(std::string_view text) {
  const auto fields = words_of(unabbreviated(text));
  if (fields.size() != 5)
    return invalid_input(
        concat("cron expression '", text.substr(0, 80), "'"),
        concat("it has ", fields.size(), " fields, not five"),
        "write minute hour day-of-month month day-of-week, e.g. '30 2 * * mon-fri', or @daily");
  Cron cron;
  for (const Result<>& ok :
       {add_field(kRules[0], fields[0], cron.minutes_), add_field(kRules[1], fields[1], cron.hours_),
        add_field(kRules[2], fields[2], cron.days_), add_field(kRules[3], fields[3], cron.months_),
        add_field(kRules[4], fields[4], cron.weekdays_)}) {
    if (!ok) return tl::unexpected(ok.error());
  }
  cron.every_hour_ = fields[1].starts_with('*');
  cron.any_day_ = fields[2].starts_with('*');
  cron.any_weekday_ = fields[4].starts_with('*');
  if (!cron.next(0, TimeZone::find("UTC").value()))
    return invalid_input(concat("cron expression '", text, "'"), "no year has such a day", "e.g. 0 0 28 2 *");
  return cron;
}

std::optional<std::int64_t> Cron::next(std::int64_t after_ns, const TimeZone& in) const {
  using namespace std::chrono;
  const date::time_zone& zone = in.zone();
  const date::sys_seconds after{floor<seconds>(nanoseconds(after_ns))};
  // A day earlier than today's: clocks may have been moved across midnight.
  date::local_days day = date::floor<date::days>(zone.to_local(after)) - date::days(1);
  for (int n = 0; n < kLongestWait_days; ++n, day += date::days(1)) {
    const date::year_month_day date(day);
    const auto of = [](auto part) { return static_cast<std::size_t>(static_cast<unsigned>(part)); };
    const bool is_day = days_[of(date.day())], is_weekday = weekdays_[date::weekday(day).c_encoding()];
    const bool fits = any_day_ || any_weekday_ ? is_day && is_weekday : is_day || is_weekday;
    if (!months_[of(date.month())] || !fits) continue;
    std::optional<date::sys_seconds> best;
    const auto offer = [&](date::sys_seconds t) {
      if (t > after && (!best || t < *best)) best = t;
    };
    for (std::size_t hour = 0; hour < 24; ++hour) {
      if (!hours_[hour]) continue;
      for (std::size_t minute = 0; minute < 60; ++minute) {
        if (!minutes_[minute]) continue;
        const date::local_seconds local = day + hours(hour) + minutes(minute);
        const date::local_info info = zone.get_info(local);
        const date::sys_seconds first(local.time_since_epoch() - info.first.offset);
        if (info.result == date::local_info::nonexistent) {
          if (!every_hour_) offer(info.first.end);
          continue;
        }
        offer(first);
        if (info.result == date::local_info::ambiguous && every_hour_)
          offer(date::sys_seconds(local.time_since_epoch() - info.second.offset));
      }
    }
    if (best) return duration_cast<nanoseconds>(best->time_since_epoch()).count();
  }
  return std::nullopt;
}

}  // namespace flamefield
