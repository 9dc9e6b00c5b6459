#pragma once

#include <chrono>
#include <cstdint>

namespace flamefield {

inline std::int64_t utc_now_ns() {
  using std::chrono::duration_cast, std::chrono::nanoseconds, std::chrono::system_clock;
  return duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count();
}

}  // namespace flamefield
