#include "services/dispatcher/set_sender.h"

#include <algorithm>

namespace flamefield {

Result<> SetSender::offer(FrameSet set) {
  if (waiting_.size() >= options_.max_unacked)
    return unavailable(concat(waiting_.size(), " sets wait to be stored"), "the dispatcher does not keep up",
                       "wait for acknowledgements");
  const std::uint64_t request = ++last_request_;
  Waiting& waiting = waiting_[request];
  waiting.message.set = std::move(set);
  waiting.offered = Clock::now();
  send(request, waiting);
  return {};
}

void SetSender::send(std::uint64_t request, Waiting& waiting) {
  waiting.sent = Clock::now();
  // A full queue is no loss: the set stays here and is sent again.
  if (auto ok = dealer_.send(waiting.message, request); !ok) last_refusal_ = ok.error().message;
}

void SetSender::read(const Delivery& delivery) {
  const auto found = waiting_.find(delivery.request);
  if (found == waiting_.end() || !delivery.message) return;
  if (const auto* no = std::get_if<Rejected>(&*delivery.message)) {
    ++refused_;
    last_refusal_ = no->error.message;
    return;  // kept, and sent again when it is due
  }
  if (!std::holds_alternative<SetStored>(*delivery.message)) return;
  slowest_ack_ = std::max(slowest_ack_, std::chrono::nanoseconds(Clock::now() - found->second.offered));
  waiting_.erase(found);
  ++acked_;
}

void SetSender::pump(std::chrono::milliseconds timeout) {
  for (auto delivery = dealer_.receive(timeout); delivery;
       delivery = dealer_.receive(std::chrono::milliseconds(0)))
    read(*delivery);
  const auto due = Clock::now() - options_.resend_after;
  for (auto& [request, waiting] : waiting_) {
    if (waiting.sent > due) continue;
    ++resent_;
    send(request, waiting);
  }
}

Result<> SetSender::drain(std::chrono::milliseconds timeout) {
  const auto deadline = Clock::now() + timeout;
  while (!waiting_.empty()) {
    if (Clock::now() >= deadline)
      return unavailable(concat(waiting_.size(), " sets are not acknowledged"),
                         last_refusal_.empty() ? "the dispatcher does not answer" : last_refusal_,
                         "is it running?");
    pump(std::chrono::milliseconds(50));
  }
  return {};
}

}  // namespace flamefield
