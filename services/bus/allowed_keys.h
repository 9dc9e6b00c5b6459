#pragma once

#include <chrono>
#include <filesystem>
#include <mutex>
#include <optional>
#include <string>

#include "services/bus/keys.h"

namespace flamefield {

// The allow-list of a key directory as it is now: a key that is added or taken away counts within kMemory,
// without a restart. Thread-safe.
class AllowedKeys {
 public:
  explicit AllowedKeys(const KeyRing& ring) : directory_(ring.directory()), list_(ring.allowed()) {}

  std::optional<std::string> role_of(const std::string& public_key);

 private:
  void refresh();

  static constexpr std::chrono::milliseconds kMemory{200};
  const std::filesystem::path directory_;  // empty: the list never changes
  std::mutex mutex_;
  AllowList list_;
  std::chrono::steady_clock::time_point looked_;
};

}  // namespace flamefield
