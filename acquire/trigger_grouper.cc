#include "acquire/trigger_grouper.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <span>

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::size_t kMostDubious = 4;  // sets that wait for a second witness
constexpr std::size_t kRecent = 64;      // pulses whose opening is remembered
constexpr long long kLeastTolerance_ns = 200'000;
constexpr double kMostSkipped = 64;  // pulses that a cadence is trusted to bridge

std::int64_t median(std::vector<std::int64_t> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

TriggerGrouper::TriggerGrouper(GrouperOptions options)
    : options_(std::move(options)),
      last_wanted_(options_.pulses > 0 ? options_.pulses : std::numeric_limits<std::int64_t>::max()),
      states_(options_.cameras.size()),
      tallies_(options_.cameras.size()) {
  expect(!options_.cameras.empty(), "an array has cameras");
  expect(options_.deadline_ns > 0 && options_.silence_ns > 0 && options_.least_patience_ns > 0 &&
             options_.max_jump > 0,
         "waiting times and counts are positive");
  for (CameraState& state : states_) state.base = options_.first_count;
}

std::vector<FrameSet> TriggerGrouper::add(std::size_t camera, Arrival arrival, std::int64_t now_ns) {
  expect(camera < states_.size(), "the array has this camera");
  ++tallies_[camera].frames_in;
  const CameraState& state = states_[camera];
  Entry entry;
  entry.common_ns = state.clock.common_of(arrival.exposure_utc_ns);
  entry.is_trusted = !arrival.trigger_count || !state.base || state.clock.is_settled(train_.half_width_ns());
  // A settled clock knows better than to within a quarter of a period.
  entry.tolerance_ns = train_.half_width_ns();
  if (state.base && entry.is_trusted) {
    entry.tolerance_ns = std::min<std::int64_t>(
        entry.tolerance_ns, std::max(kLeastTolerance_ns, std::llround(6 * state.clock.spread_ns())));
  }
  entry.arrival = std::move(arrival);
  count(camera, place(camera, std::move(entry), now_ns));
  return close_ready(now_ns);
}

void TriggerGrouper::count(std::size_t camera, Fate fate) {
  CameraTally& tally = tallies_[camera];
  switch (fate) {
    case Fate::Placed:
      break;  // counted when its set goes out
    case Fate::Late:
      ++tally.late;
      break;
    case Fate::Duplicate:
      ++tally.duplicates;
      break;
    case Fate::Unwanted:
      ++tally.unwanted;
      break;
    case Fate::BeforeStart:
      ++tally.before_start;
      break;
    case Fate::Implausible:
      ++tally.implausible;
      break;
    case Fate::Extra:
      ++tally.extra;
      break;
  }
}

std::vector<FrameSet> TriggerGrouper::lose(std::size_t camera, LossCause cause, std::int64_t now_ns) {
  expect(camera < states_.size(), "the array has this camera");
  states_[camera].pending.push_back({cause, states_[camera].last_pulse});
  return close_ready(now_ns);
}

std::vector<FrameSet> TriggerGrouper::lose_camera(std::size_t camera, std::int64_t now_ns) {
  expect(camera < states_.size(), "the array has this camera");
  states_[camera].is_lost = true;
  return close_ready(now_ns);
}

void TriggerGrouper::rejoin(std::size_t camera) {
  expect(camera < states_.size(), "the array has this camera");
  CameraState& state = states_[camera];
  state.clock.reset();
  state.base.reset();
  state.is_lost = false;
  state.joined_pulse = next_pulse_ - 1;
}

std::vector<FrameSet> TriggerGrouper::advance(std::int64_t now_ns) {
  return close_ready(now_ns);
}

// --- which pulse a frame belongs to

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

// --- sets

TriggerGrouper::OpenSet* TriggerGrouper::open_set(std::int64_t pulse) {
  if (open_.empty() || pulse < open_.front().pulse || pulse > open_.back().pulse) return nullptr;
  return &open_[static_cast<std::size_t>(pulse - open_.front().pulse)];
}

// Opens a set for every pulse up to this one; false, and nothing done, when that jump is not credible.
bool TriggerGrouper::open_until(std::int64_t pulse, std::int64_t now_ns) {
  if (pulse - next_pulse_ >= options_.max_jump) return false;
  for (; next_pulse_ <= pulse; ++next_pulse_) {
    OpenSet set;
    set.pulse = next_pulse_;
    set.opened_ns = now_ns;
    set.entries.resize(states_.size());
    open_.push_back(std::move(set));
    recent_.push_back(now_ns);
    if (recent_.size() > kRecent) recent_.pop_front();
  }
  return true;
}

void TriggerGrouper::pop_back() {
  train_.forget(open_.back().pulse);
  open_.pop_back();
  if (!recent_.empty()) recent_.pop_back();
  --next_pulse_;
}

std::vector<FrameSet> TriggerGrouper::end_at(std::int64_t last_pulse, std::int64_t now_ns) {
  last_wanted_ = std::min(last_wanted_, std::max<std::int64_t>(last_pulse, 0));
  open_until(last_wanted_, now_ns);
  while (!open_.empty() && open_.back().pulse > last_wanted_) {
    for (std::size_t i = 0; i < states_.size(); ++i) {
      if (open_.back().entries[i]) ++tallies_[i].unwanted;
    }
    pop_back();
  }
  is_ending_ = true;
  return close_ready(now_ns);
}

std::vector<FrameSet> TriggerGrouper::flush(std::int64_t now_ns) {
  std::vector<FrameSet> out;
  while (!open_.empty()) out.push_back(close_front(now_ns, true));
  for (std::size_t i = 0; i < states_.size(); ++i) {
    tallies_[i].unplaced += static_cast<std::int64_t>(states_[i].pending.size());
    states_[i].pending.clear();
  }
  return out;
}

// How long a set may wait. Once most cameras are there, stragglers get one period.
std::int64_t TriggerGrouper::patience_ns(const OpenSet& set) const {
  const auto period_ns = train_.period_ns();
  if (!period_ns || 2 * set.filled <= states_.size()) return options_.deadline_ns;
  return std::min(options_.deadline_ns, std::max(options_.least_patience_ns, *period_ns));
}

// A frame that only one camera has may be of noise on its trigger line, and its number then belongs to a
// pulse that is yet to come. While nobody else waits for anything, a second witness is waited for.
bool TriggerGrouper::is_dubious(const OpenSet& set) const {
  if (is_ending_ || states_.size() < 3 || set.filled != 1 || open_.size() > kMostDubious) return false;
  const auto witness = [](const OpenSet& s) {
    return std::find_if(s.entries.begin(), s.entries.end(),
                        [](const auto& entry) { return entry.has_value(); }) -
           s.entries.begin();
  };
  const auto alive = std::count_if(states_.begin(), states_.end(), [](const auto& s) { return !s.is_lost; });
  return alive >= 3 && std::all_of(open_.begin(), open_.end(), [&](const OpenSet& other) {
           return other.filled == 0 || (other.filled == 1 && witness(other) == witness(set));
         });
}

// When the camera will count as lost if it stays silent: the second pulse that it has nothing of, while half
// of the cameras or more have, gets that old.
std::optional<std::int64_t> TriggerGrouper::silence_due_ns(std::size_t camera) const {
  const CameraState& state = states_[camera];
  const std::int64_t second = std::max(state.last_pulse, state.joined_pulse) + 2;
  if (state.is_lost || second >= next_pulse_) return std::nullopt;
  const auto ahead = static_cast<std::size_t>(std::count_if(
      states_.begin(), states_.end(), [&](const CameraState& s) { return s.last_pulse >= second; }));
  if (2 * ahead < states_.size()) return std::nullopt;
  const std::int64_t age = next_pulse_ - second;  // from the end of recent_
  const std::size_t at = recent_.size() - std::min(recent_.size(), static_cast<std::size_t>(age));
  return recent_[at] + options_.silence_ns;
}

void TriggerGrouper::give_up_silent_cameras(std::int64_t now_ns) {
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const auto due_ns = silence_due_ns(i);
    if (due_ns && *due_ns <= now_ns) states_[i].is_lost = true;
  }
}

bool TriggerGrouper::is_overdue(std::size_t camera) const {
  if (open_.empty() || 2 * open_.front().filled <= states_.size()) return false;
  const CameraState& state = states_[camera];
  const std::int64_t pulse = open_.front().pulse;
  return is_owed(camera, pulse) && state.asked_pulse < pulse;
}

std::vector<std::size_t> TriggerGrouper::take_overdue(std::int64_t now_ns) {
  std::vector<std::size_t> out;
  if (open_.empty() || now_ns - open_.front().opened_ns < options_.overdue_ns) return out;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (!is_overdue(i)) continue;
    states_[i].asked_pulse = open_.front().pulse;
    out.push_back(i);
  }
  return out;
}

std::optional<std::int64_t> TriggerGrouper::next_deadline_ns() const {
  std::optional<std::int64_t> next;
  const auto consider = [&](std::int64_t due_ns) { next = std::min(next.value_or(due_ns), due_ns); };
  if (!open_.empty() && !is_dubious(open_.front())) {
    consider(open_.front().opened_ns + patience_ns(open_.front()));
  }
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (const auto due_ns = silence_due_ns(i)) consider(*due_ns);
    if (is_overdue(i)) consider(open_.front().opened_ns + options_.overdue_ns);
  }
  return next;
}

// Whether the camera's frame of a pulse may still come.
bool TriggerGrouper::is_owed(std::size_t camera, std::int64_t pulse) const {
  const CameraState& state = states_[camera];
  return !state.is_lost && std::max(state.last_pulse, state.joined_pulse) < pulse;
}

bool TriggerGrouper::can_close(const OpenSet& set, std::int64_t now_ns) const {
  if (set.filled == states_.size()) return true;
  if (is_dubious(set)) return false;
  if (now_ns - set.opened_ns >= patience_ns(set)) return true;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (!set.entries[i] && is_owed(i, set.pulse)) return false;
  }
  return true;
}

LossCause TriggerGrouper::cause_of_gap(std::size_t camera, std::int64_t pulse, bool is_final) {
  CameraState& state = states_[camera];
  if (!state.pending.empty() && state.pending.front().after_pulse < pulse) {
    PendingLoss failure = state.pending.front();
    state.pending.pop_front();
    // A stray packet may fail a buffer of its own beside the one that is missed: the gap is named by what
    // says most.
    if (failure.cause == LossCause::Incomplete && !state.pending.empty() &&
        state.pending.front().after_pulse == failure.after_pulse && state.last_pulse <= pulse + 1) {
      failure = state.pending.front();
      state.pending.pop_front();
      ++tallies_[camera].unplaced;
    }
    return failure.cause;
  }
  if (pulse <= state.joined_pulse) return LossCause::CameraLost;
  if (state.last_pulse > pulse) return LossCause::Missed;
  if (state.is_lost) return LossCause::CameraLost;
  return is_final || state.answered_pulse >= pulse ? LossCause::Missed : LossCause::Late;
}

// Without counters a pulse that one camera alone saw, and all others passed by, was none.
bool TriggerGrouper::is_nobodys_pulse(const OpenSet& set) const {
  if (has_counters_ || set.filled != 1) return false;
  std::size_t passed = 0;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (states_[i].is_lost || set.entries[i]) continue;
    if (states_[i].last_pulse <= set.pulse) return false;
    ++passed;
  }
  return passed >= 2;
}

void TriggerGrouper::drop_front() {
  const std::int64_t pulse = open_.front().pulse;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (open_.front().entries[i]) ++tallies_[i].extra;
    if (states_[i].last_pulse >= pulse) --states_[i].last_pulse;
    if (states_[i].joined_pulse >= pulse) --states_[i].joined_pulse;
  }
  open_.pop_front();
  train_.close_gap(pulse);
  --next_pulse_;
  if (recent_.size() > open_.size())
    recent_.erase(recent_.end() - static_cast<std::ptrdiff_t>(open_.size()) - 1);
  for (OpenSet& set : open_) {
    --set.pulse;
    for (auto& entry : set.entries) {
      if (entry) entry->arrival.frame.pulse = set.pulse;
    }
  }
}

FrameSet TriggerGrouper::close_front(std::int64_t now_ns, bool is_final) {
  OpenSet open = std::move(open_.front());
  open_.pop_front();
  FrameSet set;
  set.capture = options_.capture;
  set.kind = options_.kind;
  set.pulse = open.pulse;
  set.index = open.pulse - 1;
  set.complete_time_ns = now_ns;
  const auto common = train_.at(open.pulse);
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    CameraTally& tally = tallies_[i];
    CameraState& state = states_[i];
    if (std::optional<Entry>& entry = open.entries[i]) {
      const std::int64_t camera_ns = entry->arrival.exposure_utc_ns;
      times.push_back(camera_ns);
      if (common) {
        const bool is_outlier = std::abs(entry->common_ns - common->time_ns) > train_.half_width_ns();
        if (is_outlier && state.clock.is_settled(train_.half_width_ns())) state.clock.reset();
        state.clock.learn(camera_ns, common->time_ns);
      }
      state.last_closed = open.pulse;
      set.frames.push_back(std::move(entry->arrival.frame));
      ++tally.delivered;
      // Failures before this frame that left no gap behind were not for a pulse of this capture.
      while (!state.pending.empty() && state.pending.front().after_pulse < open.pulse) {
        state.pending.pop_front();
        ++tally.unplaced;
      }
    } else {
      const LossCause cause = cause_of_gap(i, open.pulse, is_final);
      set.losses.push_back({options_.cameras[i], cause});
      ++tally.losses[static_cast<std::size_t>(cause)];
    }
  }
  set.pulse_time_ns = times.empty() ? open.opened_ns : median(std::move(times));
  return set;
}

std::vector<FrameSet> TriggerGrouper::close_ready(std::int64_t now_ns) {
  std::vector<FrameSet> out;
  give_up_silent_cameras(now_ns);
  while (!open_.empty() && can_close(open_.front(), now_ns)) {
    if (is_nobodys_pulse(open_.front())) {
      drop_front();
    } else {
      out.push_back(close_front(now_ns, false));
    }
  }
  return out;
}

}  // namespace flamefield
