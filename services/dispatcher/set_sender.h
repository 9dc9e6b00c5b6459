#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>

#include "services/bus/bus.h"

namespace flamefield {

// A capture's end of the bus: keeps every set until the dispatcher says that it is on disk, and sends it
// again when that takes too long. One thread.
class SetSender {
 public:
  struct Options {
    std::size_t max_unacked = 64;  // then offer() says Unavailable
    std::chrono::milliseconds resend_after{3'000};
  };
  // `dealer` is connected to the dispatcher as "capture".
  SetSender(Dealer dealer, const Options& options) : dealer_(std::move(dealer)), options_(options) {}

  // Takes the set over. Unavailable: too many wait for their acknowledgement; pump() and offer it again.
  Result<> offer(FrameSet set);

  // Reads acknowledgements for at most `timeout` (returns after the first batch of them), resends what is
  // due.
  void pump(std::chrono::milliseconds timeout);

  // Pumps until everything is acknowledged. Unavailable when that is not so in time; nothing is discarded.
  Result<> drain(std::chrono::milliseconds timeout);

  std::size_t unacked() const { return waiting_.size(); }
  std::int64_t acked() const { return acked_; }
  std::int64_t resent() const { return resent_; }
  std::int64_t refused() const { return refused_; }  // "try later" answers, e.g. disk full
  const std::string& last_refusal() const { return last_refusal_; }
  std::chrono::nanoseconds slowest_ack() const { return slowest_ack_; }

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    PutSet message;
    Clock::time_point offered, sent;
  };
  void send(std::uint64_t request, Waiting& waiting);
  void read(const Delivery& delivery);

  Dealer dealer_;
  Options options_;
  std::map<std::uint64_t, Waiting> waiting_;  // by request number
  std::uint64_t last_request_ = 0;
  std::int64_t acked_ = 0, resent_ = 0, refused_ = 0;
  std::string last_refusal_;
  std::chrono::nanoseconds slowest_ack_{0};
};

}  // namespace flamefield
