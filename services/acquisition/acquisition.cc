#include "services/acquisition/acquisition.h"

#include <algorithm>
#include <chrono>
#include <ctime>
#include <thread>

#include "proto/utc.h"
#include "services/bus/client.h"
#include "services/log/log.h"

namespace flamefield {

namespace {

using std::chrono::milliseconds;

// "20260301T101500123-burst": sorts by time, says what it is, and is unique to the millisecond.
std::string capture_id(CaptureKind kind) {
  const std::int64_t now_ms = utc_now_ns() / 1'000'000;
  const std::time_t seconds = now_ms / 1000;
  std::tm utc{};
  gmtime_r(&seconds, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y%m%dT%H%M%S", &utc);
  char millis[8];
  std::snprintf(millis, sizeof millis, "%03d", static_cast<int>(now_ms % 1000));
  return concat(text, millis, "-", name_of(kind));
}

}  // namespace

Acquisition::Acquisition(Bus& bus, AcquisitionOptions options)
    : bus_(bus), options_(std::move(options)), outbox_(bus, options_.dispatcher_endpoint) {
  for (const CameraAddress& camera : options_.cameras) {
    state_.cameras.push_back(
        {.name = camera.name, .address = camera.address, .connected = true, .losses = {}});
  }
}

Result<std::unique_ptr<Acquisition>> Acquisition::open(Bus& bus, AcquisitionOptions options) {
  std::unique_ptr<Acquisition> service(new Acquisition(bus, std::move(options)));
  service->router_ = std::make_unique<Router>(bus);
  for (const std::string& endpoint : service->options_.endpoints) {
    if (auto bound = service->router_->bind(endpoint); !bound) return tl::unexpected(bound.error());
  }
  auto array = CameraArray::open(service->options_.cameras, service->options_.settings);
  if (!array) return tl::unexpected(array.error());
  service->array_ = std::move(*array);
  return service;
}

Result<> Acquisition::run(std::stop_token stop) {
  Result<> sending;
  // The sender outlives the last capture: it stops only when everything is stored, or nothing can be.
  std::jthread sender([&](std::stop_token sender_stop) { sending = outbox_.run(sender_stop); });
  while (!stop.stop_requested()) {
    beat_ = std::chrono::steady_clock::now().time_since_epoch();
    if (const auto delivery = router_->receive(milliseconds(50))) {
      const Message reply =
          delivery->message ? answer(*delivery->message, stop) : Message(Rejected{delivery->message.error()});
      (void)router_->send(delivery->peer, reply, delivery->request);  // a client that left misses its answer
    }
    if (state().phase != CapturePhase::Idle && outbox_.waiting() > options_.most_waiting_sets) {
      log_event(LogLevel::Error, "capture-stopped",
                {{"capture", capture_.id},
                 {"why", "sets come faster than they can be stored"},
                 {"waiting_sets", outbox_.waiting()},
                 {"dispatcher_says", outbox_.last_refusal()}});
      finish(stop);
    }
    if (state().phase != CapturePhase::Idle && array_->wait_done(milliseconds(0))) finish(stop);
  }
  if (state().phase != CapturePhase::Idle) finish(stop);
  sender.request_stop();
  sender.join();
  return sending;
}

Message Acquisition::answer(const Message& question, std::stop_token stop) {
  if (const auto* request = std::get_if<StartCapture>(&question)) return start(*request, stop);
  if (const auto* request = std::get_if<GetPreview>(&question)) return preview(*request);
  if (std::holds_alternative<StopCapture>(question)) {
    if (state().phase != CapturePhase::Idle) finish(stop);
    return state();
  }
  if (std::holds_alternative<GetCapture>(question)) return state();
  return Rejected{invalid_input("a request to the camera array", "it is not one that the array knows",
                                "ask the dispatcher instead")
                      .value()};
}

Message Acquisition::start(const StartCapture& request, std::stop_token stop) {
  if (state().phase != CapturePhase::Idle) {
    return Rejected{unavailable("capture '" + state().id + "' is running", "the array takes one at a time",
                                "wait for it, or run 'flamefield stop'")
                        .value()};
  }
  capture_ = {.id = request.id.empty() ? capture_id(request.kind) : request.id,
              .kind = request.kind,
              .started_time_ns = utc_now_ns(),
              .finished_time_ns = 0,
              .pulses = 0,
              .cameras = array_->names()};
  if (!tell_dispatcher(capture_, stop)) {
    return Rejected{unavailable("capture not started",
                                "the dispatcher does not answer, so nothing could be stored",
                                "check that it runs and that its disk has room")
                        .value()};
  }
  if (options_.hooks.before) options_.hooks.before(request.kind);
  {
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Armed;
    state_.id = capture_.id;
    state_.kind = request.kind;
    state_.pulses_wanted = request.pulses;
    state_.sets = state_.sets_stored = 0;
    for (auto& camera : state_.cameras) camera.frames = 0, camera.losses.clear();
  }
  const auto started = array_->start({.capture = capture_.id, .kind = request.kind, .pulses = request.pulses},
                                     [this](FrameSet set) { on_set(std::move(set)); });
  if (!started) {
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Idle;
    return Rejected{started.error()};
  }
  if (options_.hooks.armed) options_.hooks.armed(request.kind, request.pulses);
  return state();
}

void Acquisition::on_set(FrameSet set) {
  set.index = set.pulse - 1;
  {
    const std::scoped_lock lock(mutex_);
    ++state_.sets;
    for (auto& camera : state_.cameras) {
      for (const Frame& frame : set.frames) {
        if (frame.camera == camera.name) ++camera.frames, newest_[camera.name] = frame;
      }
      for (const FrameLoss& loss : set.losses) {
        if (loss.camera == camera.name) ++camera.losses[std::string(name_of(loss.cause))];
      }
    }
  }
  outbox_.put(std::move(set));
}

// Ends the capture: no more pulses, every set delivered by the cameras, every set durable.
void Acquisition::finish(std::stop_token stop) {
  if (options_.hooks.finished) options_.hooks.finished();
  const CaptureReport report = array_->stop();
  {
    const std::scoped_lock lock(mutex_);
    state_.phase = CapturePhase::Draining;
    for (std::size_t i = 0; i < report.cameras.size(); ++i)
      state_.cameras[i].connected = !report.cameras[i].is_lost;
  }
  const auto give_up = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (outbox_.waiting() > 0) {
    beat_ = std::chrono::steady_clock::now().time_since_epoch();
    // A stop of the service waits as well, but not for ever: without a dispatcher nothing can be stored.
    if (stop.stop_requested() && std::chrono::steady_clock::now() > give_up) break;
    std::this_thread::sleep_for(milliseconds(5));
  }
  capture_.finished_time_ns = utc_now_ns();
  capture_.pulses = report.pulses;
  tell_dispatcher(capture_, stop);
  const std::scoped_lock lock(mutex_);
  state_.phase = CapturePhase::Idle;
}

bool Acquisition::tell_dispatcher(const PutCapture& capture, std::stop_token stop) {
  auto client = Client::connect(bus_, "producer", unique_name("capture"), options_.dispatcher_endpoint);
  if (!client) return false;
  for (int attempt = 0; attempt < 3 && !(attempt > 0 && stop.stop_requested()); ++attempt) {
    if (client->ask_for<Accepted>(capture, std::chrono::seconds(3))) return true;
  }
  return false;
}

CaptureState Acquisition::state() const {
  const std::vector<std::string> lost =
      array_ ? array_->progress().lost_cameras : std::vector<std::string>();  // takes the array's lock
  const std::scoped_lock lock(mutex_);
  CaptureState state = state_;
  if (state.phase != CapturePhase::Idle) {
    for (auto& camera : state.cameras)
      camera.connected = std::find(lost.begin(), lost.end(), camera.name) == lost.end();
  }
  state.sets_stored = state.sets - std::min(state.sets, outbox_.waiting());
  for (auto& camera : state.cameras) {
    if (const auto frame = newest_.find(camera.name); frame != newest_.end()) {
      camera.newest_age_s = static_cast<double>(utc_now_ns() - frame->second.arrival_time_ns) * 1e-9;
    }
  }
  return state;
}

std::optional<Frame> Acquisition::newest_frame(const std::string& camera) const {
  const std::scoped_lock lock(mutex_);
  const auto found = newest_.find(camera);
  return found == newest_.end() ? std::nullopt : std::optional(found->second);
}

Message Acquisition::preview(const GetPreview& request) const {
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
