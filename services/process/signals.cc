#include "services/process/signals.h"

#include <csignal>
#include <ctime>

namespace flamefield {

namespace {

sigset_t watched() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  return set;
}

}  // namespace

SignalStop::SignalStop() {
  const sigset_t set = watched();
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);  // inherited by every thread from here on
  std::signal(SIGXFSZ, SIG_IGN);                // a file that grows too large is an error, not the end
  watcher_ = std::jthread([this](std::stop_token end) {
    const sigset_t waited = watched();
    const timespec tick{0, 100'000'000};
    while (!end.stop_requested()) {
      const int got = ::sigtimedwait(&waited, nullptr, &tick);
      if (got <= 0) continue;
      if (source_.stop_requested()) ::_Exit(128 + got);
      source_.request_stop();
    }
  });
}

SignalStop::~SignalStop() = default;

}  // namespace flamefield
