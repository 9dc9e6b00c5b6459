#include "services/bus/client.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>

namespace flamefield {

using Clock = std::chrono::steady_clock;

Result<Client> Client::connect(Bus& bus, const std::string& role, const std::string& name,
                               const std::string& endpoint) {
  Dealer dealer(bus, role, name);
  if (auto ok = dealer.connect(endpoint); !ok) return tl::unexpected(ok.error());
  return Client(std::move(dealer));
}

Result<Message> Client::ask(const Message& question, std::chrono::milliseconds timeout) {
  const std::uint64_t request = ++last_request_;
  if (auto ok = dealer_.send(question, request); !ok) return tl::unexpected(ok.error());
  const auto deadline = Clock::now() + timeout;
  while (true) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now());
    auto delivery = dealer_.receive(std::max(left, std::chrono::milliseconds(0)));
    if (delivery && delivery->request == request) {
      if (!delivery->message) return tl::unexpected(delivery->message.error());
      if (auto* no = std::get_if<Rejected>(&*delivery->message)) return tl::unexpected(no->error);
      return std::move(*delivery->message);
    }
    // An answer that comes after its question gave up is dropped; the question is asked again if need be.
    if (delivery && delivery->message && delivery->request == 0)
      unasked_.push_back(std::move(*delivery->message));
    if (Clock::now() >= deadline)
      return unavailable("no answer from the dispatcher", concat("waited ", timeout.count(), " ms"),
                         "is it running, and is this machine's key on its allow-list?");
  }
}

Result<> Client::post(const Message& message) {
  posted_ = ++last_request_;
  return dealer_.send(message, posted_);
}

std::optional<Message> Client::next(std::chrono::milliseconds timeout) {
  if (unasked_.empty()) {
    auto delivery = dealer_.receive(timeout);
    if (!delivery || !delivery->message) return std::nullopt;
    if (delivery->request != 0 && delivery->request != posted_) return std::nullopt;
    return std::move(*delivery->message);
  }
  Message first = std::move(unasked_.front());
  unasked_.pop_front();
  return first;
}

std::string unique_name(const std::string& stem) {
  static std::atomic<int> counter = 0;
  std::array<char, 64> host{};
  ::gethostname(host.data(), host.size() - 1);
  std::string name = concat(stem, '-', host.data(), '-', ::getpid(), '-', ++counter);
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c) && c != '.'; }, '-');
  return name;
}

}  // namespace flamefield
