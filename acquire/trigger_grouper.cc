#include "acquire/trigger_grouper.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "acquire/median.h"
#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::size_t kMostDubious = 4;  // sets that wait for a second witness
constexpr std::size_t kRecent = 64;      // pulses whose opening is remembered
constexpr long long kLeastTolerance_ns = 200'000;

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
