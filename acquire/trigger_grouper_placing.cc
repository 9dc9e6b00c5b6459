// Which pulse a frame belongs to.
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <span>

#include "acquire/median.h"
#include "acquire/trigger_grouper.h"

namespace flamefield {

namespace {

constexpr double kMostSkipped = 64;  // pulses that a cadence is trusted to bridge

}  // namespace

// Counters have 32 bits and wrap: the pulse nearest to the camera's last one.
std::optional<std::int64_t> TriggerGrouper::pulse_of_count(std::size_t camera, std::int64_t count) const {
  const CameraState& state = states_[camera];
  if (!state.base) return std::nullopt;
  const auto since =
      static_cast<std::uint32_t>(count) - static_cast<std::uint32_t>(*state.base + state.last_pulse);
  return state.last_pulse + static_cast<std::int32_t>(since);
}

TriggerGrouper::Fate TriggerGrouper::place(std::size_t camera, Entry entry, std::int64_t now_ns) {
  CameraState& state = states_[camera];
  const std::optional<std::int64_t> trigger_count = entry.arrival.trigger_count;
  has_counters_ = has_counters_ || trigger_count;
  std::optional<std::int64_t> pulse;
  if (trigger_count && state.base) {
    const std::int64_t counted = *pulse_of_count(camera, *trigger_count);
    if (std::abs(counted - next_pulse_) >= options_.max_jump) return Fate::Implausible;
    pulse = pulse_by_count(entry, counted);
    if (!pulse) {  // noise that the counter took for an edge
      state.base = *state.base + 1;
      ++tallies_[camera].count_slips;
    } else if (*pulse != counted) {
      state.base = *state.base + counted - *pulse;
      ++tallies_[camera].count_slips;
    }
  } else {
    // A clock that may be off by as much as pulses are apart tells nothing.
    if (trigger_count && entry.arrival.clock_error_ns > train_.half_width_ns()) return Fate::Implausible;
    pulse = pulse_by_time(entry);
    if (pulse && trigger_count) state.base = *trigger_count - *pulse;
  }
  return pulse ? insert(camera, std::move(entry), *pulse, now_ns) : Fate::Extra;
}

// The counter is right unless two cameras or more say otherwise. None: no pulse was then.
std::optional<std::int64_t> TriggerGrouper::pulse_by_count(const Entry& entry, std::int64_t pulse) const {
  if (!entry.is_trusted) return pulse;
  const auto known = train_.at(pulse);
  if (known && std::abs(known->time_ns - entry.common_ns) <= train_.half_width_ns()) return pulse;
  const auto other = train_.pulse_at(entry.common_ns, 2);
  const bool is_proof = other && train_.is_unambiguous(entry.common_ns) &&
                        std::abs(train_.at(*other)->time_ns - entry.common_ns) <= entry.tolerance_ns;
  if (is_proof) return other;
  if (!known || known->votes < 2) return pulse;
  if (const auto witness = train_.pulse_at(entry.common_ns)) return witness;
  const auto before = train_.before(entry.common_ns);
  if (!before) return pulse;
  return train_.at(*before + 1) ? std::nullopt : std::optional(*before + 1);
}

std::optional<std::int64_t> TriggerGrouper::pulse_by_time(const Entry& entry) const {
  if (const auto pulse = train_.pulse_at(entry.common_ns)) return pulse;
  const auto newest = train_.newest();
  if (!newest) return next_pulse_;
  if (entry.common_ns > newest->second.time_ns) {
    const std::int64_t since_ns = entry.common_ns - newest->second.time_ns;
    std::int64_t skipped = 0;
    if (const auto period_ns = train_.period_ns()) {
      const double periods = static_cast<double>(since_ns) / static_cast<double>(*period_ns);
      const double off_ns = std::abs(periods - std::round(periods)) * static_cast<double>(*period_ns);
      const bool is_on_time = off_ns <= static_cast<double>(train_.half_width_ns());
      if (is_on_time && periods >= 1.5 && periods < kMostSkipped) skipped = std::llround(periods) - 1;
    }
    return newest->first + 1 + skipped;
  }
  const auto before = train_.before(entry.common_ns);
  if (!before) return (open_.empty() ? next_pulse_ : open_.front().pulse) - 1;  // too old to be told
  return train_.at(*before + 1) ? std::nullopt : std::optional(*before + 1);
}

TriggerGrouper::Fate TriggerGrouper::insert(std::size_t camera, Entry entry, std::int64_t pulse,
                                            std::int64_t now_ns) {
  CameraState& state = states_[camera];
  if (pulse < 1) return Fate::BeforeStart;
  if (pulse > last_wanted_) return Fate::Unwanted;
  if (!open_until(pulse, now_ns)) return Fate::Implausible;
  state.is_lost = false;
  const bool is_repeated = pulse <= state.last_pulse;
  state.last_pulse = std::max(state.last_pulse, pulse);
  OpenSet* set = open_set(pulse);
  if (!set) return is_repeated ? Fate::Duplicate : Fate::Late;
  if (set->entries[camera]) {
    // Noise may sit where the true frame belongs.
    const auto known = train_.at(pulse);
    const auto is_near = [&](const Entry& e) {
      return known && std::abs(e.common_ns - known->time_ns) <= train_.half_width_ns();
    };
    if (!entry.is_trusted || !is_near(entry) || is_near(*set->entries[camera])) return Fate::Duplicate;
    count(camera, Fate::Extra);
    --set->filled;
  }
  ++set->filled;
  entry.arrival.frame.pulse = pulse;
  set->entries[camera] = std::move(entry);
  review(pulse, now_ns);
  return Fate::Placed;
}

// The largest group of trusted clocks that agree. Only cameras that count have a vote on what a number means,
// and only when they outnumber the others.
PulseTrain::Entry TriggerGrouper::agreed_time(const OpenSet& set) const {
  struct Witness {
    std::int64_t common_ns;
    bool counts;
  };
  std::vector<Witness> trusted;
  std::vector<std::int64_t> all;
  for (const auto& entry : set.entries) {
    if (!entry) continue;
    all.push_back(entry->common_ns);
    if (entry->is_trusted) trusted.push_back({entry->common_ns, entry->arrival.trigger_count.has_value()});
  }
  if (trusted.empty()) return {median(std::move(all)), 0};
  std::ranges::sort(trusted, {}, &Witness::common_ns);
  // Of groups of one size, the one that keeps the cadence.
  const auto before = train_.at(set.pulse - 1);
  const auto period_ns = train_.period_ns();
  const auto off_beat_ns = [&](std::size_t at) {
    return before && period_ns ? std::abs(trusted[at].common_ns - before->time_ns - *period_ns) : 0;
  };
  std::size_t first = 0, most = 0;
  for (std::size_t begin = 0, end = 0; begin < trusted.size(); ++begin) {
    while (end < trusted.size() &&
           trusted[end].common_ns - trusted[begin].common_ns <= train_.half_width_ns())
      ++end;
    const std::size_t size = end - begin;
    if (size > most || (size == most && off_beat_ns(begin) < off_beat_ns(first))) most = size, first = begin;
  }
  const auto group = std::span(trusted).subspan(first, most);
  const auto votes = static_cast<std::size_t>(std::ranges::count(group, true, &Witness::counts));
  return {group[most / 2].common_ns, 2 * most > trusted.size() ? votes : std::min<std::size_t>(votes, 1)};
}

// After a frame came to a pulse: where the clocks agree, entries that do not belong leave, and those of other
// pulses that do belong come.
void TriggerGrouper::review(std::int64_t pulse, std::int64_t now_ns) {
  OpenSet& reviewed = *open_set(pulse);
  const PulseTrain::Entry agreed = agreed_time(reviewed);
  train_.note(pulse, agreed);
  // Two that disagree: the one that came first was noise, and the pulse begins only now.
  if (agreed.votes < 2 && reviewed.filled == 2) reviewed.opened_ns = now_ns;
  if (agreed.votes < 2) return;
  const auto agrees = [&](const Entry& entry) {
    return std::abs(entry.common_ns - agreed.time_ns) <= train_.half_width_ns();
  };
  for (std::size_t camera = 0; camera < states_.size(); ++camera) {
    const OpenSet* set = open_set(pulse);
    if (!set) return;
    const auto& own = set->entries[camera];
    if (own && own->is_trusted && !agrees(*own)) {
      correct(camera, pulse, now_ns);
      continue;
    }
    for (const OpenSet& other : open_) {
      const auto& entry = other.entries[camera];
      if (other.pulse == pulse || own || !entry || !entry->is_trusted || !agrees(*entry)) continue;
      correct(camera, other.pulse, now_ns);
      break;
    }
  }
}

// Places the frames of a camera anew, from the pulse on that turned out to be wrong.
void TriggerGrouper::correct(std::size_t camera, std::int64_t from_pulse, std::int64_t now_ns) {
  if (corrections_ > static_cast<int>(2 * states_.size())) return;  // two each are enough; a loop must end
  ++corrections_;
  CameraState& state = states_[camera];
  std::vector<Entry> entries;
  for (OpenSet& set : open_) {
    if (set.pulse < from_pulse || !set.entries[camera]) continue;
    entries.push_back(std::move(*set.entries[camera]));
    set.entries[camera].reset();
    --set.filled;
    if (set.filled == 0) train_.forget(set.pulse);
  }
  state.last_pulse = state.last_closed;
  for (const OpenSet& set : open_) {
    if (set.entries[camera]) state.last_pulse = std::max(state.last_pulse, set.pulse);
  }
  for (Entry& entry : entries) count(camera, place(camera, std::move(entry), now_ns));
  --corrections_;
  // Pulses that nobody else has seen either have not been yet.
  if (corrections_ == 0 && !is_ending_) {
    while (!open_.empty() && open_.back().filled == 0) pop_back();
  }
}

}  // namespace flamefield
