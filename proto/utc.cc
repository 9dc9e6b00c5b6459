#include "proto/utc.h"

#include <cstdio>
#include <ctime>

namespace flamefield {

namespace {

// The format's whole seconds, then the milliseconds.
std::string text_of(std::int64_t time_ns, const char* format, const char* point) {
  const std::time_t seconds = time_ns / 1'000'000'000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char whole[32], text[48];
  std::strftime(whole, sizeof whole, format, &utc);
  std::snprintf(text, sizeof text, "%s%s%03d", whole, point, static_cast<int>(time_ns / 1'000'000 % 1000));
  return text;
}

}  // namespace

std::string utc_text(std::int64_t time_ns) {
  return time_ns == 0 ? std::string() : text_of(time_ns, "%Y-%m-%dT%H:%M:%S", ".") + "Z";
}

std::string utc_stamp(std::int64_t time_ns) {
  return text_of(time_ns, "%Y%m%dT%H%M%S", "");
}

}  // namespace flamefield
