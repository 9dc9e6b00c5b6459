#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <string>
#include <thread>

#include "services/store/file.h"
#include "tests/cli/program.h"

namespace flamefield {

inline ProgramResult run_flamefield(const std::filesystem::path& folder, const std::string& arguments) {
  return flamefield(folder, arguments);
}

// An address for simulated cameras that no other test process uses, away from those of tests/acquire.
inline std::string unused_loopback_address() {
  const int pid = ::getpid();
  return concat("127.", 200 + pid / 200 % 50, ".", pid % 200, ".2");
}

// Polls until `holds`, for at most a minute.
inline bool eventually(const std::function<bool()>& holds) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!holds()) {
    if (std::chrono::steady_clock::now() > deadline) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return true;
}

}  // namespace flamefield
