#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>

#include "proto/error.h"

namespace flamefield {

// What a child process knows: a number that outlives it, and how the one before it ended.
struct Life {
  std::atomic<std::int64_t>& in_hand;  // 0: nothing; set by the child, kept when it dies
  std::int64_t lost = 0;               // what the last child had in hand when it died
  std::string death;                   // "killed by signal 11 (Segmentation fault)"; empty: the first life
};

// Runs `live` in a child process, and again in a new one each time a signal kills it. Ends, with the child's
// exit code, when the child ends by itself; SIGTERM, SIGINT and SIGUSR1 are passed on to it. Gives up, with
// 1, when children die with nothing in hand five times in a row. To be called while there is one thread only.
int supervise(const std::function<int(Life&)>& live);

}  // namespace flamefield
