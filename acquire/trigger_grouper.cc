#include "acquire/trigger_grouper.h"

#include <algorithm>
#include <cstdlib>
#include <limits>

#include "proto/check.h"

namespace flamefield {

namespace {

constexpr std::size_t kRememberedTimes = 64;
constexpr std::int64_t kDefaultWindow_ns = 5'000'000;  // until two pulses have shown their spacing

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
  expect(options_.deadline_ns > 0 && options_.silence_ns > 0 && options_.silent_pulses > 0 &&
             options_.max_jump > 0,
         "waiting times and counts are positive");
}

std::vector<FrameSet> TriggerGrouper::add(std::size_t camera, Arrival arrival, std::int64_t now_ns) {
  expect(camera < states_.size(), "the array has this camera");
  CameraTally& tally = tallies_[camera];
  CameraState& state = states_[camera];
  ++tally.frames_in;
  const std::optional<std::int64_t> pulse = pulse_of(arrival);
  if (!pulse) {
    ++tally.late;
  } else if (*pulse < 1) {
    ++tally.before_start;
  } else if (*pulse > last_wanted_) {
    ++tally.unwanted;
  } else if (!open_until(*pulse, now_ns)) {
    ++tally.implausible;
  } else {
    state.is_lost = false;
    state.late_sets = 0;
    const bool is_repeated = *pulse <= state.last_pulse;
    state.last_pulse = std::max(state.last_pulse, *pulse);
    if (open_.empty() || *pulse < open_.front().pulse) {
      ++(is_repeated ? tally.duplicates : tally.late);
    } else {
      OpenSet& set = open_[static_cast<std::size_t>(*pulse - open_.front().pulse)];
      if (set.arrivals[camera]) {
        ++tally.duplicates;
      } else {
        ++set.filled;
        remember_time(*pulse, arrival.exposure_utc_ns);
        arrival.frame.pulse = *pulse;
        set.arrivals[camera] = std::move(arrival);
      }
    }
  }
  return close_ready(now_ns);
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

std::vector<FrameSet> TriggerGrouper::advance(std::int64_t now_ns) {
  return close_ready(now_ns);
}

std::vector<FrameSet> TriggerGrouper::end_at(std::int64_t last_pulse, std::int64_t now_ns) {
  last_wanted_ = std::min(last_wanted_, std::max<std::int64_t>(last_pulse, 0));
  open_until(last_wanted_, now_ns);
  while (!open_.empty() && open_.back().pulse > last_wanted_) {
    for (std::size_t i = 0; i < states_.size(); ++i) {
      if (open_.back().arrivals[i]) ++tallies_[i].unwanted;
    }
    open_.pop_back();
    --next_pulse_;
  }
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

std::optional<std::int64_t> TriggerGrouper::next_deadline_ns() const {
  if (open_.empty()) return std::nullopt;
  const OpenSet& front = open_.front();
  const std::int64_t silence = std::min(options_.silence_ns, options_.deadline_ns);
  // Once the silent ones have been looked for, only the deadline is left.
  return front.opened_ns + (front.is_checked ? options_.deadline_ns : silence);
}

// None: a frame without a count that is older than the pulses it could belong to.
std::optional<std::int64_t> TriggerGrouper::pulse_of(const Arrival& arrival) const {
  if (arrival.trigger_count) return *arrival.trigger_count - options_.first_count;
  if (times_.empty()) return next_pulse_;
  const auto distance = [&](const PulseTime& entry) {
    return std::abs(entry.time_ns - arrival.exposure_utc_ns);
  };
  const auto nearest = std::min_element(
      times_.begin(), times_.end(), [&](const auto& a, const auto& b) { return distance(a) < distance(b); });
  std::int64_t window_ns = kDefaultWindow_ns;
  if (times_.size() > 1) {
    window_ns = std::numeric_limits<std::int64_t>::max();
    for (std::size_t i = 1; i < times_.size(); ++i) {
      const std::int64_t pulses = times_[i].pulse - times_[i - 1].pulse;
      window_ns = std::min(window_ns, (times_[i].time_ns - times_[i - 1].time_ns) / pulses / 2);
    }
  }
  if (distance(*nearest) <= window_ns) return nearest->pulse;
  if (arrival.exposure_utc_ns > times_.back().time_ns) return next_pulse_;
  return std::nullopt;
}

// Opens a set for every pulse up to this one; false, and nothing done, when that jump is not credible.
bool TriggerGrouper::open_until(std::int64_t pulse, std::int64_t now_ns) {
  if (pulse - next_pulse_ >= options_.max_jump) return false;
  for (; next_pulse_ <= pulse; ++next_pulse_) {
    OpenSet set;
    set.pulse = next_pulse_;
    set.opened_ns = now_ns;
    set.arrivals.resize(states_.size());
    open_.push_back(std::move(set));
  }
  return true;
}

void TriggerGrouper::remember_time(std::int64_t pulse, std::int64_t time_ns) {
  if (!times_.empty() && (pulse <= times_.back().pulse || time_ns <= times_.back().time_ns)) return;
  times_.push_back({pulse, time_ns});
  if (times_.size() > kRememberedTimes) times_.pop_front();
}

// A camera that the oldest set still waits for, and that no later one has heard of either, is silent.
void TriggerGrouper::give_up_silent_cameras(std::int64_t now_ns) {
  if (open_.empty()) return;
  OpenSet& front = open_.front();
  if (now_ns - front.opened_ns < std::min(options_.silence_ns, options_.deadline_ns)) return;
  front.is_checked = true;
  if (static_cast<std::int64_t>(open_.size()) <= options_.silent_pulses) return;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    if (states_[i].last_pulse < front.pulse) states_[i].is_lost = true;
  }
}

bool TriggerGrouper::can_close(const OpenSet& set, std::int64_t now_ns) const {
  if (set.filled == states_.size() || now_ns - set.opened_ns >= options_.deadline_ns) return true;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    const bool may_come = !set.arrivals[i] && !states_[i].is_lost && states_[i].last_pulse < set.pulse;
    if (may_come) return false;
  }
  return true;
}

LossCause TriggerGrouper::cause_of_gap(std::size_t camera, std::int64_t pulse, bool is_final) {
  CameraState& state = states_[camera];
  if (!state.pending.empty() && state.pending.front().after_pulse < pulse) {
    const LossCause cause = state.pending.front().cause;
    state.pending.pop_front();
    return cause;
  }
  if (state.last_pulse > pulse) return LossCause::Missed;
  if (state.is_lost) return LossCause::CameraLost;
  if (is_final) return LossCause::Missed;
  if (++state.late_sets >= options_.silent_pulses) state.is_lost = true;
  return LossCause::Late;
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
  std::vector<std::int64_t> times;
  for (std::size_t i = 0; i < states_.size(); ++i) {
    CameraTally& tally = tallies_[i];
    std::optional<Arrival>& arrival = open.arrivals[i];
    if (arrival) {
      times.push_back(arrival->exposure_utc_ns);
      set.frames.push_back(std::move(arrival->frame));
      ++tally.delivered;
      // Failures before this frame that left no gap behind were not for a pulse of this capture.
      std::deque<PendingLoss>& pending = states_[i].pending;
      while (!pending.empty() && pending.front().after_pulse < open.pulse) {
        pending.pop_front();
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
  for (;;) {
    give_up_silent_cameras(now_ns);
    if (open_.empty() || !can_close(open_.front(), now_ns)) return out;
    out.push_back(close_front(now_ns, false));
  }
}

}  // namespace flamefield
