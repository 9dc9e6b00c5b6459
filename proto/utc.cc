#include "proto/utc.h"

#include <cstdio>
#include <ctime>

namespace flamefield {

std::string utc_text(std::int64_t time_ns) {
  if (time_ns == 0) return {};
  const std::time_t seconds = time_ns / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char day[32], text[48];
  std::strftime(day, sizeof day, "%Y-%m-%dT%H:%M:%S", &utc);
  std::snprintf(text, sizeof text, "%s.%03dZ", day, static_cast<int>(time_ns / 1'000'000 % 1000));
  return text;
}

}  // namespace flamefield
