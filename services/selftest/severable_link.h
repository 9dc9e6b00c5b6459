#pragma once

#include <atomic>
#include <memory>
#include <string>
#include <thread>

#include "proto/error.h"

namespace flamefield {

// A wire that can be cut: passes TCP connections on from a port of its own (on 127.0.0.1) to another one.
class SeverableLink {
 public:
  static Result<std::unique_ptr<SeverableLink>> open(int to_port);
  ~SeverableLink();
  SeverableLink(const SeverableLink&) = delete;

  int port() const { return port_; }
  void cut() { ++cuts_; }  // resets all connections of the moment; new ones are passed on again

 private:
  SeverableLink(int listener, int port, int to_port);
  void run(std::stop_token stop);

  int listener_, port_, to_port_;
  std::atomic<int> cuts_{0};
  std::jthread thread_;
};

}  // namespace flamefield
