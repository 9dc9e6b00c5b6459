// The life of a capture: started, from rest or from standby; fed; ended; stored; closed.
#include <algorithm>

#include "proto/utc.h"
#include "services/acquisition/account.h"
#include "services/acquisition/acquisition.h"
#include "services/log/log.h"

namespace flamefield {

using std::chrono::seconds;

namespace {

// "20260301T101500123-burst": sorts by time, says what it is, and is unique to the millisecond.
std::string capture_id(CaptureKind kind) {
  return concat(utc_stamp(utc_now_ns()), "-", name_of(kind));
}

constexpr bool begins_in_standby(CaptureKind kind) {
  return kind == CaptureKind::Burst || kind == CaptureKind::Live;
}

Rejected refusal(const std::string& problem, std::string_view why, std::string_view suggestion) {
  return Rejected{unavailable(problem, why, suggestion).value()};
}

}  // namespace

Message Acquisition::start(const StartCapture& request) {
  const CapturePhase now = phase();
  if (is_capturing(now)) {
    return refusal("capture '" + state().id + "' is running", "the array takes one at a time",
                   "wait for it, or run 'flamefield stop'");
  }
  if (!request.store) return show(request);
  if (request.pre_pulses > 0 && (now != CapturePhase::Standby || !begins_in_standby(request.kind))) {
    return refusal(concat("capture with ", request.pre_pulses, " pulses from before"),
                   "only a burst that begins in standby has any",
                   "run 'flamefield capture standby' some time before the burst");
  }
  next_report_ = {};
  close_left_behind();
  PutCapture capture;
  capture.id = request.id.empty() ? capture_id(request.kind) : request.id;
  capture.kind = request.kind;
  capture.started_time_ns = utc_now_ns();
  capture.cameras = array_->names();
  capture.pulses_wanted = request.pulses;
  capture.settings = settings_text(options_.settings);
  if (!journal_.left_behind()) note(capture);  // first: a program that dies from here on leaves no riddle
  bool is_told = false;
  for (int attempt = 0; attempt < 3 && !is_told && !journal_.left_behind(); ++attempt) {
    beat();
    is_told = tell_dispatcher(capture, seconds(3));
  }
  if (!is_told) {
    const std::scoped_lock lock(mutex_);
    if (!journal_.left_behind()) journal_.clear();
    return refusal("capture not started", "the dispatcher does not answer, so nothing could be stored",
                   "check that it runs and that its disk has room");
  }
  if (now == CapturePhase::Standby && !begins_in_standby(request.kind)) disarm();
  {
    const std::scoped_lock lock(mutex_);
    capture_ = std::move(capture);
    begin(request);
  }
  if (is_armed_) return state();  // pulses have been coming all the time
  const auto armed = arm({.capture = state().id, .kind = request.kind, .pulses = request.pulses});
  if (armed) return state();
  PutCapture failed;
  {
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Idle;
    capture_.end = CaptureEnd::Stopped;
    capture_.end_reason = "the cameras could not be armed";
    capture_.finished_time_ns = utc_now_ns();
    journal_.clear();
    failed = capture_;
  }
  tell_dispatcher(failed, seconds(1));
  return Rejected{armed.error()};
}

// Pictures for whoever asks for previews, until stopped: no capture, so nothing is told, noted or stored.
Message Acquisition::show(const StartCapture& request) {
  if (request.pulses != 0 || request.pre_pulses != 0) {
    return Rejected{invalid_input("pictures that are only shown", "a number of pulses was asked for",
                                  "leave it out: they are shown until stopped")
                        .value()};
  }
  if (is_armed_) disarm();
  {
    const std::scoped_lock lock(mutex_);
    shows_only_ = true;
    begin_state(request, request.id);
  }
  const auto armed = arm({.capture = "shown", .kind = request.kind, .pulses = 0});
  if (armed) return state();
  const std::scoped_lock lock(mutex_);
  shows_only_ = false;
  state_.phase = CapturePhase::Idle;
  return Rejected{armed.error()};
}

void Acquisition::note(const PutCapture& capture) {
  const std::scoped_lock lock(mutex_);
  journal_.note(capture);
}

Message Acquisition::stand_by() {
  const CapturePhase now = phase();
  if (is_capturing(now)) {
    return refusal("capture '" + state().id + "' is running", "standby is for the time between captures",
                   "wait for it, or run 'flamefield stop'");
  }
  stands_by_ = true;
  if (now == CapturePhase::Standby) return state();
  {
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Standby;
  }
  const auto armed = arm({.capture = "standby", .kind = CaptureKind::Live, .pulses = 0});
  if (armed) return state();
  stands_by_ = false;
  const std::scoped_lock lock(mutex_);
  state_.phase = CapturePhase::Idle;
  return Rejected{armed.error()};
}

Result<> Acquisition::arm(const CaptureOptions& options) {
  if (options_.hooks.before) options_.hooks.before(options.kind);
  {
    const std::scoped_lock lock(mutex_);
    pulses_seen_ = pulse_base_ = 0;
    receipts_before_.clear();
    history_.clear();
  }
  const auto started = array_->start(options, [this](FrameSet set) { on_set(std::move(set)); });
  if (!started) return started;
  is_armed_ = true;
  if (options_.hooks.armed) options_.hooks.armed(options.kind, options.pulses);
  if (action_trigger_) {
    action_trigger_->schedule_with(array_->common_clock());
    action_trigger_->start(options_.action_rate_hz, options.pulses);
  }
  return {};
}

// Every pulse that was triggered is out as a set when this returns.
void Acquisition::disarm() {
  if (action_trigger_) action_trigger_->stop();
  if (options_.hooks.finished) options_.hooks.finished();
  const CaptureReport report = array_->stop();
  is_armed_ = false;
  const std::scoped_lock lock(mutex_);
  if (state_.phase == CapturePhase::Armed && !shows_only_)
    capture_.accounts = accounts_of(state_, report.cameras, receipts_before_);
  for (std::size_t i = 0; i < report.cameras.size(); ++i)
    state_.cameras[i].connected = !report.cameras[i].is_lost;
}

// With mutex_ held.
void Acquisition::begin_state(const StartCapture& request, const std::string& id) {
  state_.phase = CapturePhase::Armed;
  state_.id = id;
  state_.kind = request.kind;
  state_.pulses_wanted = request.pulses;
  state_.sets = state_.sets_stored = state_.pre_pulses = 0;
  for (auto& camera : state_.cameras) camera.frames = 0, camera.losses.clear(), camera.counters.clear();
  previews_.count_from_zero();
}

// With mutex_ held: from the next set on, sets belong to the capture; and those of standby's memory that are
// asked for.
void Acquisition::begin(const StartCapture& request) {
  begin_state(request, capture_.id);
  pulse_base_ = is_armed_ ? pulses_seen_ : 0;
  receipts_before_ =
      is_armed_ ? receipts_of(array_->progress(), array_->names()) : std::vector<CameraReceipt>();
  auto past = history_.take_last(request.pre_pulses);
  sets_before_ = state_.pre_pulses = static_cast<std::int64_t>(past.size());
  capture_.pre_pulses = sets_before_;
  journal_.note(capture_);
  for (FrameSet& set : past) keep(std::move(set));
}

void Acquisition::on_set(FrameSet set) {
  const std::int64_t waiting = outbox_.waiting();
  const std::scoped_lock lock(mutex_);
  previews_.update(set, waiting);
  pulses_seen_ = set.pulse;
  const std::int64_t pulse = set.pulse - pulse_base_;
  const bool is_wanted =
      state_.phase == CapturePhase::Armed && (state_.pulses_wanted == 0 || pulse <= state_.pulses_wanted);
  if (shows_only_) return;
  if (is_wanted) {
    keep(std::move(set));
  } else {
    history_.push(std::move(set));
  }
}

void Acquisition::keep(FrameSet set) {
  set.capture = capture_.id;
  set.kind = capture_.kind;
  set.pulse -= pulse_base_;
  set.index = state_.sets;
  for (Frame& frame : set.frames) frame.pulse = set.pulse;
  ++state_.sets;
  for (auto& camera : state_.cameras) {
    for (const Frame& frame : set.frames) camera.frames += frame.camera == camera.name ? 1 : 0;
    for (const FrameLoss& loss : set.losses) {
      if (loss.camera == camera.name) ++camera.losses[std::string(name_of(loss.cause))];
    }
  }
  take_accounts();
  journal_.note(capture_);
  outbox_.put(std::move(set));
}

void Acquisition::take_accounts() {
  const CaptureProgress progress = array_->progress();
  capture_.accounts = accounts_of(state_, receipts_of(progress, array_->names()), receipts_before_);
  for (std::size_t i = 0; i < state_.cameras.size(); ++i)
    state_.cameras[i].counters = capture_.accounts[i].counters;
  // Pulses that some camera has seen, and whose sets are not complete yet, count too.
  std::int64_t seen = progress.pulses_seen - pulse_base_;
  if (state_.pulses_wanted > 0) seen = std::min(seen, state_.pulses_wanted);
  capture_.pulses = std::max(state_.sets, seen + sets_before_);
}

bool Acquisition::has_all_pulses() const {
  const std::scoped_lock lock(mutex_);
  return state_.pulses_wanted > 0 && state_.sets >= state_.pulses_wanted + sets_before_;
}

// No more pulses; every set delivered by the cameras. Standby goes on after a complete burst.
void Acquisition::end_capture(CaptureEnd end, const std::string& reason) {
  const bool goes_on = stands_by_ && begins_in_standby(state().kind) && end == CaptureEnd::Complete;
  if (!goes_on && is_armed_) disarm();
  if (shows_only_) {
    const std::scoped_lock lock(mutex_);
    shows_only_ = false;
    state_.phase = CapturePhase::Idle;
    return;
  }
  PutCapture ended;
  {
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Draining;
    capture_.pulses = state_.sets;
    capture_.end = end;
    capture_.end_reason = reason;
    for (std::size_t i = 0; i < state_.cameras.size() && i < capture_.accounts.size(); ++i)
      state_.cameras[i].counters = capture_.accounts[i].counters;
    journal_.note(capture_);
    ended = capture_;
  }
  if (end != CaptureEnd::Storage) return;
  log_event(LogLevel::Error, "capture-stopped",
            {{"capture", ended.id}, {"why", reason}, {"waiting_sets", outbox_.waiting()}});
  tell_dispatcher(ended, seconds(1));  // an event, if the ledger can still take one
}

// Every set is durable.
void Acquisition::close_capture() {
  if (Clock::now() < next_report_) return;
  PutCapture closed;
  {
    const std::scoped_lock lock(mutex_);
    closed = capture_;
  }
  closed.finished_time_ns = utc_now_ns();
  if (!tell_dispatcher(closed, seconds(1))) {
    next_report_ = Clock::now() + seconds(1);
    return;
  }
  const std::scoped_lock lock(mutex_);
  capture_ = std::move(closed);
  journal_.clear();
  state_.phase = is_armed_ ? CapturePhase::Standby : CapturePhase::Idle;
}

}  // namespace flamefield
