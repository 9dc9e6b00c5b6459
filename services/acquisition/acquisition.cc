#include "services/acquisition/acquisition.h"

#include <algorithm>
#include <chrono>
#include <thread>

#include "proto/utc.h"
#include "services/bus/client.h"
#include "services/bus/roles.h"
#include "services/log/log.h"

namespace flamefield {

using std::chrono::milliseconds;
using std::chrono::seconds;

namespace {

constexpr milliseconds kIdleTick{50}, kDrainTick{5};
constexpr seconds kStorePatience{10};   // of a service that is asked to stop, for what cannot be stored
constexpr seconds kAnswerPatience{20};  // of someone who asked for the end of a capture
constexpr seconds kReportInterval{1};   // between two tries to tell the dispatcher what became of a capture
constexpr milliseconds kOpenRetry{250};

}  // namespace

Acquisition::Acquisition(Bus& bus, AcquisitionOptions options, CaptureJournal journal)
    : bus_(bus),
      options_(std::move(options)),
      outbox_(bus, options_.dispatcher_endpoint),
      journal_(std::move(journal)),
      history_(options_.history),
      previews_(PreviewPolicy{options_.most_waiting_sets}) {
  for (const CameraAddress& camera : options_.cameras) {
    state_.cameras.push_back(
        {.name = camera.name, .address = camera.address, .connected = true, .losses = {}});
  }
}

Result<std::unique_ptr<Acquisition>> Acquisition::open(Bus& bus, AcquisitionOptions options) {
  auto journal = CaptureJournal::open(options.journal);
  if (!journal) return tl::unexpected(journal.error());
  std::unique_ptr<Acquisition> service(new Acquisition(bus, std::move(options), std::move(*journal)));
  service->router_ = std::make_unique<Router>(bus);
  for (const std::string& endpoint : service->options_.endpoints) {
    if (auto bound = service->router_->bind(endpoint); !bound) return tl::unexpected(bound.error());
  }
  if (auto ok = service->open_cameras(); !ok) return tl::unexpected(ok.error());
  return service;
}

Result<> Acquisition::open_cameras() {
  const auto give_up = Clock::now() + options_.open_patience;
  auto array = CameraArray::open(options_.cameras, options_.settings);
  while (!array && array.error().code == ErrorCode::Unavailable && Clock::now() < give_up) {
    std::this_thread::sleep_for(kOpenRetry);
    array = CameraArray::open(options_.cameras, options_.settings);
  }
  if (!array) return tl::unexpected(array.error());
  array_ = std::move(*array);
  if (options_.network) {
    const auto plan = array_->share_link(*options_.network);
    if (!plan) return tl::unexpected(plan.error());
    for (const std::string& warning : plan->warnings)
      log_event(LogLevel::Warning, "bandwidth", {{"warning", warning}});
  }
  if (options_.action_rate_hz > 0) {
    auto trigger = ActionTrigger::open(array_->addresses(), options_.settings.action.value_or(ActionKeys{}));
    if (!trigger) return tl::unexpected(trigger.error());
    action_trigger_ = std::move(*trigger);
  }
  return {};
}

Result<> Acquisition::run(std::stop_token stop) {
  Result<> sending;
  // The sender outlives the last capture: it stops only when everything is stored, or nothing can be.
  std::jthread sender([&](std::stop_token sender_stop) { sending = outbox_.run(sender_stop); });
  while (!stop.stop_requested()) {
    beat();
    serve_requests();
    follow_capture(false);
  }
  stands_by_ = false;
  if (phase() == CapturePhase::Armed) end_capture(CaptureEnd::Stopped, "the service was stopped");
  // A stop of the service drains as well, but not for ever: without a dispatcher nothing can be stored. What
  // is given up then, the journal tells the next program.
  const auto give_up = Clock::now() + kStorePatience;
  while (is_capturing(phase()) && Clock::now() < give_up) {
    beat();
    serve_requests();
    follow_capture(true);
  }
  if (is_armed_) disarm();
  sender.request_stop();
  sender.join();
  return sending;
}

void Acquisition::serve_requests() {
  const bool is_draining = phase() == CapturePhase::Draining;
  const auto delivery = router_->receive(is_draining ? kDrainTick : kIdleTick);
  if (!delivery) return;
  const auto reply = answer(*delivery);
  if (reply) (void)router_->send(delivery->peer, *reply, delivery->request);  // a client that left misses it
}

// None: the answer comes when the capture has ended.
std::optional<Message> Acquisition::answer(const Delivery& delivery) {
  if (!delivery.message) return Rejected{delivery.message.error()};
  const Message& question = *delivery.message;
  if (!may_send(delivery.role, question)) return Rejected{forbidden("the camera array", delivery.role)};
  if (const auto* request = std::get_if<StartCapture>(&question)) return start(*request);
  if (const auto* request = std::get_if<GetPreview>(&question)) return preview(*request);
  if (std::holds_alternative<StandBy>(question)) return stand_by();
  if (std::holds_alternative<GetCapture>(question)) return state();
  if (std::holds_alternative<StopCapture>(question)) {
    if (phase() == CapturePhase::Armed) end_capture(CaptureEnd::Stopped, {});
    if (phase() == CapturePhase::Draining) {
      askers_.push_back({delivery.peer, delivery.request, Clock::now()});
      return std::nullopt;
    }
    stands_by_ = false;
    if (is_armed_) disarm();
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Idle;
  } else {
    return Rejected{invalid_input("a request to the camera array", "it is not one that the array knows",
                                  "ask the dispatcher instead")
                        .value()};
  }
  return state();
}

// What a capture does by itself.
void Acquisition::follow_capture(bool is_stopping) {
  close_left_behind();
  const CapturePhase now = phase();
  if (now == CapturePhase::Armed) {
    if (outbox_.waiting() > options_.most_waiting_sets) {
      const std::string refusal = outbox_.last_refusal();
      end_capture(CaptureEnd::Storage,
                  concat("sets came faster than they could be stored", refusal.empty() ? "" : ": ", refusal));
    } else if (has_all_pulses()) {
      end_capture(CaptureEnd::Complete, {});
    }
  }
  if (phase() == CapturePhase::Draining && outbox_.waiting() == 0) close_capture();
  if (phase() == CapturePhase::Idle && stands_by_ && !is_stopping) {
    if (const Message reply = stand_by(); std::holds_alternative<Rejected>(reply)) {
      stands_by_ = false;
      log_event(LogLevel::Error, "standby-ended", {{"why", std::get<Rejected>(reply).error.message}});
    }
  }
  answer_askers();
}

void Acquisition::answer_askers() {
  const bool is_over = !is_capturing(phase());
  std::erase_if(askers_, [&](const Asker& asker) {
    if (!is_over && Clock::now() - asker.since < kAnswerPatience) return false;
    (void)router_->send(asker.peer, state(), asker.request);
    return true;
  });
}

bool Acquisition::tell_dispatcher(const PutCapture& capture, milliseconds patience) {
  auto client = Client::connect(bus_, "capture", unique_name("capture"), options_.dispatcher_endpoint);
  return client && client->ask_for<Accepted>(capture, patience);
}

// A program before this one ended in the middle of a capture.
void Acquisition::close_left_behind() {
  if (!journal_.left_behind() || Clock::now() < next_report_) return;
  PutCapture capture = *journal_.left_behind();
  const std::string before = capture.end_reason.empty() ? "" : concat(capture.end_reason, "; ");
  capture.end = CaptureEnd::Interrupted;
  capture.end_reason = concat(before, "the capturing program ended without closing it; ", capture.pulses,
                              " pulses were seen by then");
  capture.finished_time_ns = utc_now_ns();
  if (!tell_dispatcher(capture, seconds(1))) {
    next_report_ = Clock::now() + kReportInterval;
    return;
  }
  const std::scoped_lock lock(mutex_);
  journal_.clear();
  log_event(LogLevel::Error, "capture-interrupted",
            {{"capture", capture.id}, {"pulses_seen", capture.pulses}, {"why", capture.end_reason}});
}

CapturePhase Acquisition::phase() const {
  const std::scoped_lock lock(mutex_);
  return state_.phase;
}

CaptureState Acquisition::state() const {
  const std::vector<std::string> lost =
      array_ ? array_->progress().lost_cameras : std::vector<std::string>();  // takes the array's lock
  const std::int64_t waiting = outbox_.waiting();
  const std::string refusal = outbox_.last_refusal();
  const std::scoped_lock lock(mutex_);
  CaptureState state = state_;
  if (state.phase != CapturePhase::Idle) {
    for (auto& camera : state.cameras)
      camera.connected = std::find(lost.begin(), lost.end(), camera.name) == lost.end();
  }
  state.sets_stored = state.sets - std::min(state.sets, waiting);
  state.sets_held = history_.sets();
  state.previews_skipped = previews_.skipped();
  if (capture_.end == CaptureEnd::Storage) state.trouble = capture_.end_reason;
  if (is_capturing(state.phase) && PreviewPolicy{options_.most_waiting_sets}.stride(waiting) != 1) {
    state.trouble = concat(state.trouble, state.trouble.empty() ? "" : "; ", waiting,
                           " sets wait to be stored", refusal.empty() ? "" : ": ", refusal);
  }
  for (auto& camera : state.cameras) {
    if (const Frame* frame = previews_.newest(camera.name))
      camera.newest_age_s = static_cast<double>(utc_now_ns() - frame->arrival_time_ns) * 1e-9;
  }
  return state;
}

std::optional<Frame> Acquisition::newest_frame(const std::string& camera) const {
  const std::scoped_lock lock(mutex_);
  const Frame* frame = previews_.newest(camera);
  return frame ? std::optional(*frame) : std::nullopt;
}

Message Acquisition::preview(const GetPreview& request) {
  {
    const std::scoped_lock lock(mutex_);
    if (is_capturing(state_.phase) && previews_.is_paused()) {
      return Rejected{unavailable("preview of camera '" + request.camera + "'",
                                  "storing does not keep up, and recording goes first",
                                  "look again when fewer sets wait")
                          .value()};
    }
    if (request.camera.empty() && previews_.has_any()) return SetData{previews_.newest_set()};
  }
  const auto frame = newest_frame(request.camera);
  if (!frame) {
    return Rejected{not_found("no picture of camera '" + request.camera + "'",
                              "it has delivered none since the service started", "capture something first")
                        .value()};
  }
  SetData data;
  data.set.capture = "preview";
  data.set.kind = CaptureKind::Live;
  data.set.pulse = frame->pulse;
  data.set.frames = {*frame};
  return data;
}

}  // namespace flamefield
