#include "services/calibration/service.h"

#include <thread>
#include <utility>

#include "proto/utc.h"
#include "services/bus/roles.h"
#include "services/ledger/reader.h"
#include "services/log/log.h"

namespace flamefield {

namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr std::string_view kSuffix = "-calibration";

Error no_session() {
  return invalid_input("no calibration session", "none is running", "start one first").value();
}

}  // namespace

CalibrationService::CalibrationService(Bus& bus, CalibrationServiceOptions options)
    : bus_(bus), options_(std::move(options)) {}

Result<std::unique_ptr<CalibrationService>> CalibrationService::open(Bus& bus,
                                                                     CalibrationServiceOptions options) {
  std::unique_ptr<CalibrationService> service(new CalibrationService(bus, std::move(options)));
  service->router_ = std::make_unique<Router>(bus);
  for (const std::string& endpoint : service->options_.endpoints) {
    if (auto bound = service->router_->bind(endpoint); !bound) return tl::unexpected(bound.error());
  }
  return service;
}

CalibrationState CalibrationService::state() const {
  const std::scoped_lock lock(state_mutex_);
  return state_;
}

std::string CalibrationService::accepted_rig() const {
  const std::scoped_lock lock(state_mutex_);
  return accepted_rig_;
}

Result<> CalibrationService::run(std::stop_token stop) {
  close_left_behind();
  std::jthread worker([this](std::stop_token worker_stop) { work(worker_stop); });
  while (!stop.stop_requested()) {
    if (const auto delivery = router_->receive(milliseconds(50))) {
      const Message reply = !delivery->message ? Message(Rejected{delivery->message.error()})
                            : may_send(delivery->role, *delivery->message)
                                ? answer(*delivery->message)
                                : Message(Rejected{forbidden("the calibration session", delivery->role)});
      (void)router_->send(delivery->peer, reply, delivery->request);  // a client that left misses its answer
    }
  }
  worker.request_stop();
  worker.join();
  if (state().phase != CalibrationPhase::Idle) (void)on(DiscardCalibration{});
  return {};
}

Message CalibrationService::answer(const Message& question) {
  const auto reply = std::visit([this](const auto& m) { return on(m); }, question);
  return reply ? *reply : Message(Rejected{reply.error()});
}

// --- what is asked

Result<Message> CalibrationService::on(const GetCalibration&) {
  return state();
}

Result<Message> CalibrationService::on(const StartCalibration& request) {
  const std::scoped_lock lock(work_mutex_);
  if (session_) {
    return unavailable(concat("calibration session '", capture_.id, "' is running"), "there is one at a time",
                       "accept or discard it first");
  }
  CalibrationSessionOptions session;
  session.cameras = options_.cameras;
  session.board = request.board.value_or(options_.board);
  if (auto ok = validate(session.board); !ok) return tl::unexpected(ok.error());
  session.wanted_poses = static_cast<int>(request.wanted_poses);
  session.threads = options_.threads;
  session.previous = newest_calibration();
  session.solving.world_from_reference =
      upright_board(request.reference_centre_mm.value_or(options_.reference_centre_mm),
                    request.reference_azimuth_rad.value_or(options_.reference_azimuth_rad));
  session.solving.volume = options_.volume;

  auto array = connect(options_.acquisition_endpoint);
  if (!array) return tl::unexpected(array.error());
  capture_ = {.id = concat(utc_stamp(utc_now_ns()), kSuffix),
              .kind = CaptureKind::Board,
              .started_time_ns = utc_now_ns(),
              .finished_time_ns = 0,
              .pulses = 0,
              .cameras = options_.cameras};
  const auto shows = array->ask_for<CaptureState>(
      StartCapture{
          .kind = CaptureKind::Board, .pulses = 0, .id = capture_.id, .pre_pulses = 0, .store = false},
      seconds(30));
  if (!shows) return tl::unexpected(shows.error());
  array_.emplace(std::move(*array));
  session_.emplace(std::move(session));
  last_pulse_ = pulses_to_skip_ = 0;
  last_news_ = Clock::now();
  is_starved_ = false;
  wants_pose_ = wants_solution_ = false;
  {
    const std::scoped_lock state_lock(state_mutex_);
    state_ = {};
    state_.phase = CalibrationPhase::Detecting;
    state_.id = capture_.id;
    state_.automatic = request.automatic;
  }
  log_event(LogLevel::Info, "calibration-started", {{"session", capture_.id}});
  say("looking for the board");
  publish();
  changed_.notify_all();
  return state();
}

Result<Message> CalibrationService::on(const TakePose&) {
  const CalibrationPhase phase = state().phase;
  if (phase == CalibrationPhase::Idle) return tl::unexpected(no_session());
  wants_pose_ = true;
  if (phase == CalibrationPhase::Solved) {
    const std::scoped_lock lock(state_mutex_);
    state_.phase = CalibrationPhase::Detecting;
  }
  changed_.notify_all();
  return state();
}

Result<Message> CalibrationService::on(const SolveCalibration&) {
  {
    const std::scoped_lock lock(state_mutex_);
    if (state_.phase == CalibrationPhase::Idle) return tl::unexpected(no_session());
    state_.phase = CalibrationPhase::Solving;
    state_.error.clear();
  }
  wants_solution_ = true;
  changed_.notify_all();
  return state();
}

Result<Message> CalibrationService::on(const AcceptCalibration& request) {
  const std::scoped_lock lock(work_mutex_);
  if (!session_) return tl::unexpected(no_session());
  if (!session_->report()) {
    return invalid_input("nothing to accept", "the poses that were taken have not been solved",
                         "solve first");
  }
  const CalibrationReport& found = *session_->report();
  const CalibrationState now = state();
  PutCalibration accepted{.calibration = {}, .rig = found.rig};
  Calibration& c = accepted.calibration;
  c.accepted_by = request.accepted_by;
  c.note = request.note;
  c.capture = capture_.id;
  c.poses = session_->poses();
  c.rms_px = found.rms_px;
  c.volume_mean_px = found.expected_volume_error.mean_px;
  c.volume_worst_px = found.expected_volume_error.worst_px;
  c.worst_camera = found.expected_volume_error.worst_camera;
  c.verdict = now.verdict;
  c.moved = now.moved;
  for (const auto& camera : now.cameras) {
    if (camera.shift_px <= c.worst_shift_px) continue;
    c.worst_shift_px = camera.shift_px;
    c.most_shifted = camera.name;
  }
  auto dispatcher = connect(options_.dispatcher_endpoint);
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  const auto stored = dispatcher->ask_for<CalibrationStored>(accepted, seconds(10));
  if (!stored) return tl::unexpected(stored.error());
  if (auto ok = close_capture(); !ok) fail(ok.error());  // it is accepted all the same
  log_event(LogLevel::Info, "calibration-accepted",
            {{"session", capture_.id}, {"version", stored->version}, {"rig", stored->rig_id}});
  const std::scoped_lock state_lock(state_mutex_);
  state_.phase = CalibrationPhase::Idle;
  state_.accepted_version = stored->version;
  accepted_rig_ = stored->rig_id;
  state_.message = concat("accepted as version ", stored->version);
  return *stored;
}

Result<Message> CalibrationService::on(const DiscardCalibration&) {
  const std::scoped_lock lock(work_mutex_);
  if (!session_) return tl::unexpected(no_session());
  const auto closed = close_capture();
  log_event(LogLevel::Info, "calibration-discarded", {{"session", capture_.id}});
  const std::scoped_lock state_lock(state_mutex_);
  state_.phase = CalibrationPhase::Idle;
  state_.message = "discarded";
  if (!closed) return tl::unexpected(closed.error());
  return state_;
}

// --- the capture that holds the pictures, and what is known

// Sessions of a program that was killed: their pictures are there, their end is not.
void CalibrationService::close_left_behind() {
  auto reader = LedgerReader::open(options_.data_dir);
  const auto captures =
      reader ? reader->captures() : Result<std::vector<CaptureRow>>(std::vector<CaptureRow>());
  auto dispatcher = connect(options_.dispatcher_endpoint);
  if (!captures || !dispatcher) return;
  for (const CaptureRow& row : *captures) {
    if (row.capture.finished_time_ns != 0 || !row.capture.id.ends_with(kSuffix)) continue;
    PutCapture capture = row.capture;
    capture.pulses = row.sets;
    capture.end = CaptureEnd::Interrupted;
    capture.end_reason = "the program ended in the middle of the calibration session";
    capture.finished_time_ns = utc_now_ns();
    if (auto ok = dispatcher->ask_for<Accepted>(capture, seconds(10)); !ok) return;
    log_event(LogLevel::Warning, "calibration-interrupted", {{"session", capture.id}, {"poses", row.sets}});
  }
}

// The first set opens the capture that holds the session's pictures.
Result<> CalibrationService::store(FrameSet set) {
  auto dispatcher = connect(options_.dispatcher_endpoint);
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  if (capture_.pulses == 0) {
    if (auto ok = dispatcher->ask_for<Accepted>(capture_, seconds(10)); !ok)
      return tl::unexpected(ok.error());
  }
  set.capture = capture_.id;
  set.kind = CaptureKind::Board;
  set.index = capture_.pulses++;
  set.pulse = capture_.pulses;
  for (Frame& frame : set.frames) frame.pulse = set.pulse;
  const auto stored = dispatcher->ask_for<SetStored>(PutSet{std::move(set)}, seconds(10));
  if (!stored) return tl::unexpected(stored.error());
  return {};
}

// Ends the session, whatever goes wrong on the way.
Result<> CalibrationService::close_capture() {
  const auto shown = array_->ask_for<CaptureState>(GetCapture{}, seconds(10));
  const bool is_ours = shown && is_capturing(shown->phase) && shown->id == capture_.id;
  const auto stopped = is_ours ? array_->ask_for<CaptureState>(StopCapture{}, seconds(60)) : shown;
  array_.reset();
  session_.reset();
  if (capture_.pulses > 0) {
    if (auto ok = finish_capture(); !ok) return ok;
  }
  if (!stopped) return tl::unexpected(stopped.error());
  return {};
}

Result<> CalibrationService::finish_capture() {
  capture_.finished_time_ns = utc_now_ns();
  capture_.end = CaptureEnd::Complete;
  auto dispatcher = connect(options_.dispatcher_endpoint);
  if (!dispatcher) return tl::unexpected(dispatcher.error());
  if (auto ok = dispatcher->ask_for<Accepted>(capture_, seconds(10)); !ok) return tl::unexpected(ok.error());
  return {};
}

Result<Client> CalibrationService::connect(const std::string& endpoint) const {
  return Client::connect(bus_, "capture", unique_name("calibration"), endpoint);
}

std::optional<PreviousCalibration> CalibrationService::newest_calibration() const {
  auto reader = LedgerReader::open(options_.data_dir);
  if (!reader) return std::nullopt;
  const auto all = reader->calibrations();
  if (!all || all->empty()) return std::nullopt;
  auto newest = reader->calibration(all->back().version);
  if (!newest) return std::nullopt;
  return PreviousCalibration{newest->calibration.version, std::move(newest->rig)};
}

void CalibrationService::publish() {
  if (!session_) return;
  CalibrationState now = state();
  session_->describe(now);
  const std::scoped_lock lock(state_mutex_);
  now.phase = state_.phase;  // it may have been asked to solve in between
  now.error = state_.error;
  now.message = state_.message;
  state_ = std::move(now);
}

void CalibrationService::say(std::string message) {
  const std::scoped_lock lock(state_mutex_);
  state_.message = std::move(message);
  state_.error.clear();
}

void CalibrationService::fail(const Error& error) {
  log_event(LogLevel::Warning, "calibration-problem", {{"session", capture_.id}, {"error", error.message}});
  const std::scoped_lock lock(state_mutex_);
  state_.error = error.message;
}

}  // namespace flamefield
