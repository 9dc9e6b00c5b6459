#include "acquire/gige_camera.h"

#include <chrono>

namespace flamefield {

using std::chrono::milliseconds;

namespace {

constexpr milliseconds kRequestLatency{20};  // how long a request may wait for the next frame
constexpr milliseconds kLastFrames{120};     // longer than Aravis keeps an incomplete frame

}  // namespace

GigeCamera::GigeCamera(CameraAddress address, CameraSettings settings)
    : address_(std::move(address)), settings_(std::move(settings)), thread_([this] { run(); }) {}

GigeCamera::~GigeCamera() {
  begin_close();
  thread_.join();
}

void GigeCamera::begin_close() {
  {
    const std::lock_guard lock(mutex_);
    quit_ = true;
  }
  wake_.notify_all();
}

template <class Function>
auto GigeCamera::post(Function function) -> std::future<decltype(function())> {
  auto task = std::make_shared<std::packaged_task<decltype(function())()>>(std::move(function));
  auto future = task->get_future();
  {
    const std::lock_guard lock(mutex_);
    requests_.push_back([task] { (*task)(); });
  }
  wake_.notify_all();
  return future;
}

Result<> GigeCamera::open_now() {
  device_.reset();
  auto device = AravisDevice::open(address_);
  if (!device) return tl::unexpected(device.error());
  device_ = std::move(*device);
  Result<> ok = device_->apply(settings_);
  if (!ok) device_.reset();
  return ok;
}

std::future<Result<>> GigeCamera::open() {
  return post([this] { return open_now(); });
}

std::future<Result<>> GigeCamera::apply(CameraSettings settings) {
  return post([this, settings = std::move(settings)] {
    settings_ = settings;
    return device_ && !device_->is_lost() ? device_->apply(settings_) : open_now();
  });
}

std::future<Result<>> GigeCamera::arm(Events events) {
  return post([this, events = std::move(events)]() -> Result<> {
    events_ = events;
    loss_told_ = false;
    if (!device_ || device_->is_lost()) {
      if (auto ok = open_now(); !ok) return ok;
    }
    auto ok = device_->open_stream();
    if (!ok) {
      // Its power may have been off and on again: then it has forgotten us and its settings.
      ok = open_now();
      if (ok) ok = device_->open_stream();
    }
    is_armed_ = ok.has_value();
    return ok;
  });
}

std::future<bool> GigeCamera::reset_trigger_count() {
  return post([this] { return device_ && device_->reset_trigger_count(); });
}

std::future<std::optional<std::int64_t>> GigeCamera::trigger_count() {
  return post([this]() -> std::optional<std::int64_t> {
    if (!device_ || device_->is_lost()) return std::nullopt;
    return device_->trigger_count();
  });
}

std::future<Result<>> GigeCamera::start() {
  return post([this]() -> Result<> {
    if (!device_) return unavailable(concat("camera ", address_.name), "is not open", "open it first");
    auto ok = device_->start();
    is_streaming_ = is_armed_ && ok;
    return ok;
  });
}

std::future<Result<>> GigeCamera::software_trigger() {
  return post([this]() -> Result<> {
    if (!device_) return unavailable(concat("camera ", address_.name), "is not open", "open it first");
    return device_->software_trigger();
  });
}

std::future<StreamStatistics> GigeCamera::stop(bool answers) {
  return post([this, answers]() -> StreamStatistics {
    if (!is_armed_) return {};
    if (is_streaming_ && answers && !device_->is_lost()) {
      device_->stop();
      const auto end = std::chrono::steady_clock::now() + kLastFrames;
      while (std::chrono::steady_clock::now() < end) deliver(kRequestLatency);
    }
    is_armed_ = is_streaming_ = false;
    events_ = {};
    return device_->close_stream();
  });
}

void GigeCamera::deliver(milliseconds timeout) {
  if (device_->is_lost() && !loss_told_) {
    loss_told_ = true;
    events_.on_camera_lost();
  }
  auto next = device_->next(timeout);
  if (!next) return;
  if (auto* arrival = std::get_if<Arrival>(&*next)) {
    events_.on_frame(std::move(*arrival));
  } else {
    events_.on_loss(std::get<LossCause>(*next));
  }
}

void GigeCamera::run() {
  for (;;) {
    std::function<void()> request;
    {
      std::unique_lock lock(mutex_);
      if (!is_streaming_) wake_.wait(lock, [this] { return quit_ || !requests_.empty(); });
      if (!requests_.empty()) {
        request = std::move(requests_.front());
        requests_.pop_front();
      } else if (quit_) {
        break;
      }
    }
    if (request) {
      request();
    } else {
      deliver(kRequestLatency);
    }
  }
  if (is_streaming_ && !device_->is_lost()) device_->stop();
  device_.reset();
}

}  // namespace flamefield
