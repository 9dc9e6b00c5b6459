#include "services/acquisition/outbox.h"

#include <utility>

#include "services/bus/client.h"
#include "services/dispatcher/set_sender.h"

namespace flamefield {

void Outbox::put(FrameSet set) {
  {
    const std::scoped_lock lock(mutex_);
    queue_.push_back(std::move(set));
    ++waiting_;
  }
  changed_.notify_one();
}

Result<> Outbox::run(std::stop_token stop) {
  Dealer dealer(bus_, "capture", unique_name("acquisition"));
  if (auto ok = dealer.connect(endpoint_); !ok) return ok;
  SetSender sender(std::move(dealer), {});
  while (!stop.stop_requested()) {
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, stop, [&] { return waiting_ > 0; });
      // A full sender refuses: the set stays at the head of the queue, and its turn comes again.
      while (!queue_.empty() && sender.offer(queue_.front())) queue_.pop_front();
    }
    sender.pump(std::chrono::milliseconds(2));
    const std::scoped_lock lock(mutex_);
    waiting_ = static_cast<std::int64_t>(queue_.size() + sender.unacked());
    last_refusal_ = sender.last_refusal();
  }
  return {};
}

std::int64_t Outbox::waiting() const {
  const std::scoped_lock lock(mutex_);
  return waiting_;
}

std::string Outbox::last_refusal() const {
  const std::scoped_lock lock(mutex_);
  return last_refusal_;
}

}  // namespace flamefield
