#include "services/process/notify.h"

#include <gmock/gmock.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <cstring>

#include "tests/support/scratch.h"

namespace flamefield {
namespace {

// systemd's end of the socket.
class NotifySocket {
 public:
  NotifySocket() : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, (scratch_ / "notify").c_str(), sizeof address.sun_path - 1);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    ::setenv("NOTIFY_SOCKET", address.sun_path, 1);
  }
  ~NotifySocket() {
    ::unsetenv("NOTIFY_SOCKET");
    ::unsetenv("WATCHDOG_USEC");
    ::close(fd_);
  }
  std::string next(int timeout_ms = 5000) const {
    pollfd readable{fd_, POLLIN, 0};
    if (::poll(&readable, 1, timeout_ms) <= 0) return {};
    std::array<char, 256> text{};
    return {text.data(), static_cast<std::size_t>(::recv(fd_, text.data(), text.size(), 0))};
  }

 private:
  Scratch scratch_;
  int fd_;
};

TEST(ServiceManager, HearsThatTheServiceIsReadyAliveAndStopping) {
  const NotifySocket systemd;
  ::setenv("WATCHDOG_USEC", "40000", 1);
  {
    const ServiceManagerNotice notice([] { return true; });
    EXPECT_EQ(systemd.next(), "READY=1");
    EXPECT_EQ(systemd.next(), "WATCHDOG=1");
    EXPECT_EQ(systemd.next(), "WATCHDOG=1");
  }
  std::string last;
  for (std::string text = systemd.next(100); !text.empty(); text = systemd.next(100)) last = text;
  EXPECT_EQ(last, "STOPPING=1");
}

TEST(ServiceManager, HearsNothingFromAServiceThatHangs) {
  const NotifySocket systemd;
  ::setenv("WATCHDOG_USEC", "20000", 1);
  std::atomic<int> asked = 0;
  const ServiceManagerNotice notice([&] { return ++asked < 0; });
  EXPECT_EQ(systemd.next(), "READY=1");
  EXPECT_EQ(systemd.next(200), "");
  EXPECT_GT(asked, 1);
}

TEST(ServiceManager, IsLeftAloneWhenItDidNotStartUs) {
  ::unsetenv("NOTIFY_SOCKET");
  ::unsetenv("WATCHDOG_USEC");
  EXPECT_FALSE(notify_service_manager("READY=1"));
  EXPECT_FALSE(watchdog_interval());
}

}  // namespace
}  // namespace flamefield
