#pragma once

#include <stop_token>
#include <thread>

namespace flamefield {

// Turns Ctrl-C and SIGTERM into a stop request; a second one ends the process at once. Make it first in main:
// threads started before it would still die of the signals.
class SignalStop {
 public:
  SignalStop();
  ~SignalStop();
  SignalStop(const SignalStop&) = delete;
  std::stop_token token() const { return source_.get_token(); }

 private:
  std::stop_source source_;
  std::jthread watcher_;
};

}  // namespace flamefield
