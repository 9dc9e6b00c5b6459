#include "acquire/pulse_train.h"

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

namespace flamefield {

namespace {

constexpr std::size_t kRemembered = 64;
constexpr std::size_t kRegularFrom = 3;  // spacings
constexpr std::int64_t kMostHalfWidth_ns = 20'000'000;

}  // namespace

void PulseTrain::note(std::int64_t pulse, const Entry& entry) {
  const bool is_new = !entries_.contains(pulse);
  entries_[pulse] = entry;
  while (entries_.size() > kRemembered) entries_.erase(entries_.begin());
  if (is_new) measure();
}

void PulseTrain::close_gap(std::int64_t pulse) {
  std::map<std::int64_t, Entry> kept;
  for (const auto& [number, entry] : entries_) {
    if (number != pulse) kept[number > pulse ? number - 1 : number] = entry;
  }
  entries_ = std::move(kept);
}

std::optional<PulseTrain::Entry> PulseTrain::at(std::int64_t pulse) const {
  const auto found = entries_.find(pulse);
  return found == entries_.end() ? std::nullopt : std::optional(found->second);
}

std::optional<std::int64_t> PulseTrain::pulse_at(std::int64_t time_ns, std::size_t votes) const {
  std::optional<std::int64_t> best;
  std::int64_t best_ns = half_width_ns_;
  std::size_t best_votes = 0;
  for (const auto& [pulse, entry] : entries_) {
    const std::int64_t distance_ns = std::abs(entry.time_ns - time_ns);
    if (entry.votes < votes || distance_ns > half_width_ns_) continue;
    const bool is_better =
        !best || entry.votes > best_votes || (entry.votes == best_votes && distance_ns < best_ns);
    if (is_better) best = pulse, best_ns = distance_ns, best_votes = entry.votes;
  }
  return best;
}

bool PulseTrain::is_unambiguous(std::int64_t time_ns) const {
  return std::count_if(entries_.begin(), entries_.end(), [&](const auto& entry) {
           return entry.second.votes > 0 &&
                  std::abs(entry.second.time_ns - time_ns) <= 3 * half_width_ns_ / 2;
         }) <= 1;
}

std::optional<std::pair<std::int64_t, PulseTrain::Entry>> PulseTrain::newest() const {
  if (entries_.empty()) return std::nullopt;
  return *entries_.rbegin();
}

std::optional<std::int64_t> PulseTrain::before(std::int64_t time_ns) const {
  std::optional<std::int64_t> out;
  for (const auto& [pulse, entry] : entries_) {
    if (entry.time_ns < time_ns) out = pulse;
  }
  return out;
}

void PulseTrain::measure() {
  std::vector<std::int64_t> spacings_ns;
  for (auto next = entries_.begin(), last = next; next != entries_.end(); last = next++) {
    if (next == last || next->first != last->first + 1) continue;
    const std::int64_t spacing_ns = next->second.time_ns - last->second.time_ns;
    if (spacing_ns > 0) spacings_ns.push_back(spacing_ns);
  }
  if (spacings_ns.empty()) return;
  std::sort(spacings_ns.begin(), spacings_ns.end());
  const std::int64_t median_ns = spacings_ns[spacings_ns.size() / 2];
  const auto is_alike = [&](std::int64_t ns) { return std::abs(ns - median_ns) < median_ns / 10; };
  const auto alike =
      static_cast<std::size_t>(std::count_if(spacings_ns.begin(), spacings_ns.end(), is_alike));
  period_ns_.reset();
  if (alike >= kRegularFrom && 4 * alike >= 3 * spacings_ns.size()) period_ns_ = median_ns;
  // Pulses that are not there yet may be closer than any before; strays must not narrow it to nothing.
  half_width_ns_ = std::min(kMostHalfWidth_ns, (period_ns_ ? median_ns : spacings_ns.front()) / 4);
}

}  // namespace flamefield
