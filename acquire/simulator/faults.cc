#include "acquire/simulator/faults.h"

#include <array>
#include <charconv>
#include <optional>
#include <string>

namespace flamefield {

namespace {

using PulseSet = std::set<std::int64_t> CameraFaults::*;

struct SetKind {
  std::string_view name;
  PulseSet set;
};
constexpr std::array kSetKinds = {
    SetKind{"missed", &CameraFaults::missed_pulses}, SetKind{"unseen", &CameraFaults::unseen_pulses},
    SetKind{"extra", &CameraFaults::extra_pulses},   SetKind{"drop", &CameraFaults::dropped_packets},
    SetKind{"leader", &CameraFaults::lost_leaders},  SetKind{"trailer", &CameraFaults::lost_trailers},
    SetKind{"mute", &CameraFaults::lost_frames},     SetKind{"reorder", &CameraFaults::reordered},
    SetKind{"duplicate", &CameraFaults::duplicated}, SetKind{"repeat", &CameraFaults::repeated},
    SetKind{"corrupt", &CameraFaults::corrupt}};
constexpr std::int64_t kDelay_ns = 400'000'000;  // of "delay"

template <class T>
std::optional<T> number_of(std::string_view text) {
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// "12" or "12-20", both included.
std::optional<PulseRange> range_of(std::string_view text) {
  const std::size_t dash = text.find('-');
  const auto first = number_of<std::int64_t>(text.substr(0, dash));
  const auto last = dash == std::string_view::npos ? first : number_of<std::int64_t>(text.substr(dash + 1));
  if (!first || !last || *first < 1 || *last < *first || *last - *first > 1'000'000) return std::nullopt;
  return PulseRange{*first, *last + 1};
}

bool add(std::string_view kind, std::string_view what, CameraFaults& faults) {
  if (kind == "loss") {
    const auto share = number_of<double>(what);
    if (!share || !(*share >= 0 && *share <= 1)) return false;
    faults.packet_loss = *share;
    return true;
  }
  const auto range = range_of(what);
  if (!range) return false;
  if (kind == "dead" || kind == "cut") {
    (kind == "dead" ? faults.power_cuts : faults.link_cuts).push_back(*range);
    return true;
  }
  if (kind == "delay") {
    for (std::int64_t pulse = range->first; pulse < range->end; ++pulse) faults.delayed_ns[pulse] = kDelay_ns;
    return true;
  }
  for (const SetKind& entry : kSetKinds) {
    if (entry.name != kind) continue;
    for (std::int64_t pulse = range->first; pulse < range->end; ++pulse) (faults.*entry.set).insert(pulse);
    return true;
  }
  return false;
}

}  // namespace

Result<> add_fault(std::string_view text, CameraFaults& faults) {
  const std::size_t at = text.find('@');
  if (at != std::string_view::npos && add(text.substr(0, at), text.substr(at + 1), faults)) return {};
  std::string kinds;
  for (const SetKind& entry : kSetKinds) kinds.append(entry.name).append(" ");
  return invalid_input(concat("fault '", text, "'"), "is not KIND@PULSE, KIND@FIRST-LAST or loss@SHARE",
                       concat("use one of: ", kinds, "delay dead cut"));
}

}  // namespace flamefield
