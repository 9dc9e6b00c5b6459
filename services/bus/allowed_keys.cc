#include "services/bus/allowed_keys.h"

namespace flamefield {

std::optional<std::string> AllowedKeys::role_of(const std::string& public_key) {
  const std::scoped_lock lock(mutex_);
  refresh();
  const auto found = list_.find(public_key);
  return found == list_.end() ? std::nullopt : std::optional(found->second);
}

// A directory that cannot be read lets nobody new in, and keeps those it knows.
void AllowedKeys::refresh() {
  const auto now = std::chrono::steady_clock::now();
  if (directory_.empty() || now - looked_ < kMemory) return;
  looked_ = now;
  if (auto list = read_allow_list(directory_)) list_ = std::move(*list);
}

}  // namespace flamefield
