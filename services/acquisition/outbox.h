#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <mutex>
#include <stop_token>
#include <string>

#include "proto/frame.h"
#include "services/bus/bus.h"

namespace flamefield {

// Frame sets between the cameras' threads and the dispatcher: put() never waits, and a set stays counted here
// until it is durable.
class Outbox {
 public:
  Outbox(Bus& bus, std::string dispatcher_endpoint) : bus_(bus), endpoint_(std::move(dispatcher_endpoint)) {}

  void put(FrameSet set);  // any thread

  // Sends and waits for acknowledgements until stopped.
  Result<> run(std::stop_token stop);

  std::int64_t waiting() const;      // sets not yet acknowledged
  std::string last_refusal() const;  // why the dispatcher last said "later", e.g. disk full; empty: never

 private:
  Bus& bus_;
  const std::string endpoint_;
  mutable std::mutex mutex_;  // what follows
  std::condition_variable_any changed_;
  std::deque<FrameSet> queue_;
  std::int64_t waiting_ = 0;
  std::string last_refusal_;
};

}  // namespace flamefield
