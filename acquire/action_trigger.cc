#include "acquire/action_trigger.h"

#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

namespace flamefield {

namespace {

constexpr std::uint16_t kControlPort = 3956;
constexpr std::uint8_t kScheduled = 0x80;          // flag of the command's header
constexpr std::int64_t kAhead_ns = 20'000'000;     // that a scheduled action is announced
constexpr std::int64_t kAgreement_ns = 1'000'000;  // two readings of one clock, on a busy machine

void append(std::vector<std::uint8_t>& out, std::uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<std::uint8_t>(value >> shift));
}

}  // namespace

std::optional<SharedClock> agreed_clock(std::vector<SharedClock> clocks) {
  if (clocks.empty()) return std::nullopt;
  std::ranges::sort(clocks, {}, &SharedClock::ahead_ns);
  const SharedClock &first = clocks.front(), &last = clocks.back();
  const bool agrees = last.ahead_ns - first.ahead_ns <= first.error_ns + last.error_ns + kAgreement_ns;
  const bool is_one_unit = std::ranges::all_of(
      clocks, [&](const SharedClock& clock) { return clock.ticks_per_s == first.ticks_per_s; });
  return agrees && is_one_unit && first.ticks_per_s > 0 ? std::optional(clocks[clocks.size() / 2])
                                                        : std::nullopt;
}

std::vector<std::uint8_t> encode_action(const ActionKeys& keys, std::uint16_t request_id,
                                        std::optional<std::uint64_t> ticks) {
  std::vector<std::uint8_t> out = {0x42, ticks ? kScheduled : std::uint8_t{0}, 0x01, 0x00};
  append(out, (ticks ? 20u : 12u) << 16 | request_id);
  append(out, keys.device_key);
  append(out, keys.group_key);
  append(out, keys.group_mask);
  if (ticks) {
    append(out, static_cast<std::uint32_t>(*ticks >> 32));
    append(out, static_cast<std::uint32_t>(*ticks));
  }
  return out;
}

Result<std::unique_ptr<ActionTrigger>> ActionTrigger::open(const std::vector<std::string>& addresses,
                                                           const ActionKeys& keys) {
  std::unique_ptr<ActionTrigger> trigger(new ActionTrigger);
  trigger->keys_ = keys;
  const bool is_broadcast = !keys.broadcast_address.empty();
  for (const std::string& address : is_broadcast ? std::vector{keys.broadcast_address} : addresses) {
    in_addr parsed{};
    if (inet_pton(AF_INET, address.c_str(), &parsed) != 1) {
      return invalid_input(concat("address '", address, "' for action commands"), "is not an IPv4 address",
                           "use e.g. 192.168.7.255");
    }
    trigger->to_.push_back(parsed.s_addr);
  }
  trigger->socket_ = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  if (trigger->socket_ < 0)
    return unavailable("no socket for action commands", std::strerror(errno), "try again");
  const int on = 1;
  ::setsockopt(trigger->socket_, SOL_SOCKET, SO_BROADCAST, &on, sizeof on);
  return trigger;
}

ActionTrigger::ActionTrigger() : metronome_([this](std::int64_t, std::int64_t due_ns) { fire(due_ns); }) {}

ActionTrigger::~ActionTrigger() {
  metronome_.stop();
  if (socket_ >= 0) ::close(socket_);
}

void ActionTrigger::schedule_with(std::optional<SharedClock> clock) {
  const std::lock_guard lock(mutex_);
  clock_ = clock;
}

std::int64_t ActionTrigger::fired() const {
  const std::lock_guard lock(mutex_);
  return fired_;
}

void ActionTrigger::fire(std::int64_t due_utc_ns) {
  const std::lock_guard lock(mutex_);  // a datagram does not wait
  std::optional<std::uint64_t> ticks;
  if (clock_) {
    const auto due_ns = static_cast<long double>(due_utc_ns + kAhead_ns + clock_->ahead_ns);
    ticks = static_cast<std::uint64_t>(std::llround(due_ns * 1e-9L * clock_->ticks_per_s));
  }
  request_id_ = request_id_ == 0xffff ? std::uint16_t{1} : static_cast<std::uint16_t>(request_id_ + 1);
  const auto packet = encode_action(keys_, request_id_, ticks);
  for (std::uint32_t address : to_) {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_port = htons(kControlPort);
    to.sin_addr.s_addr = address;
    ::sendto(socket_, packet.data(), packet.size(), 0, reinterpret_cast<const sockaddr*>(&to), sizeof to);
  }
  ++fired_;
}

}  // namespace flamefield
