#include "services/process/signals.h"

#include <chrono>
#include <csignal>
#include <ctime>

namespace flamefield {

namespace {

sigset_t watched(bool drains) {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  if (drains) sigaddset(&set, SIGUSR1);
  return set;
}

}  // namespace

SignalStop::SignalStop(bool drains) {
  const sigset_t set = watched(drains);
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);  // inherited by every thread from here on
  std::signal(SIGXFSZ, SIG_IGN);                // a file that grows too large is an error, not the end
  std::signal(SIGPIPE, SIG_IGN);
  watcher_ = std::jthread([this, drains](std::stop_token end) {
    using Clock = std::chrono::steady_clock;
    const sigset_t waited = watched(drains);
    const timespec tick{0, 100'000'000};
    auto first = Clock::now();
    while (!end.stop_requested()) {
      const int got = ::sigtimedwait(&waited, nullptr, &tick);
      if (got <= 0) continue;
      if (got == SIGUSR1) {
        drain_.request_stop();
        continue;
      }
      if (!source_.stop_requested()) first = Clock::now();
      // Shells and wrappers may deliver one Ctrl-C twice.
      if (source_.stop_requested() && Clock::now() - first > std::chrono::milliseconds(500))
        ::_Exit(128 + got);
      source_.request_stop();
    }
  });
}

SignalStop::~SignalStop() = default;

}  // namespace flamefield
