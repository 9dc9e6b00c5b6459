#pragma once

#include <stop_token>
#include <thread>

namespace flamefield {

// Turns Ctrl-C and SIGTERM into a stop request; a second one ends the process at once. Make it first in main:
// threads started before it would still die of the signals.
class SignalStop {
 public:
  // `drains`: SIGUSR1 is a request to finish what is in hand and to end then; else it ends the process.
  explicit SignalStop(bool drains = false);
  ~SignalStop();
  SignalStop(const SignalStop&) = delete;
  std::stop_token token() const { return source_.get_token(); }
  std::stop_token drain() const { return drain_.get_token(); }

 private:
  std::stop_source source_, drain_;
  std::jthread watcher_;
};

}  // namespace flamefield
