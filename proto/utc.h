#pragma once

#include <chrono>
#include <cstdint>
#include <string>

namespace flamefield {

inline std::int64_t utc_now_ns() {
  using std::chrono::duration_cast, std::chrono::nanoseconds, std::chrono::system_clock;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

// "2026-03-01T10:15:00.123Z"; empty for 0.
std::string utc_text(std::int64_t time_ns);
// "20260301T101500123": for names that sort by time.
std::string utc_stamp(std::int64_t time_ns);

}  // namespace flamefield
