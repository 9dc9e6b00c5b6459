#pragma once

#include <chrono>
#include <functional>
#include <optional>
#include <stop_token>
#include <string_view>
#include <thread>

namespace flamefield {

// Tells systemd how the service does, e.g. "READY=1" or "STATUS=15 cameras", over the socket that it names in
// NOTIFY_SOCKET (sd_notify(3)). Nothing happens, and false, when systemd did not start us.
bool notify_service_manager(std::string_view state);

// How often systemd wants to hear from us; none: it does not watch.
std::optional<std::chrono::microseconds> watchdog_interval();

// While it exists, says READY, and WATCHDOG=1 for as long as is_alive() holds, twice in each interval;
// STOPPING at the end. A service that hangs is then started again.
class ServiceManagerNotice {
 public:
  explicit ServiceManagerNotice(std::function<bool()> is_alive);
  ~ServiceManagerNotice();
  ServiceManagerNotice(const ServiceManagerNotice&) = delete;
  ServiceManagerNotice& operator=(const ServiceManagerNotice&) = delete;

 private:
  std::jthread thread_;
};

}  // namespace flamefield
