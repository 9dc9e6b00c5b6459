#include "acquire/gige_camera.h"

#include <chrono>

#include "acquire/discovery.h"

namespace flamefield {

using std::chrono::milliseconds;
using std::chrono::steady_clock;

namespace {

constexpr milliseconds kRequestLatency{20};          // how long a request may wait for the next frame
constexpr milliseconds kLastFrames{120};             // longer than Aravis keeps an incomplete frame
constexpr milliseconds kProbeTimeout{90};            // three questions
constexpr milliseconds kRetry{100};                  // between two looks for a lost camera
constexpr milliseconds kSilentStream{3000};          // of a camera that is there: its stream is made anew
constexpr std::uint32_t kControlPrivilege = 0x0a00;  // GigE Vision 2.0, bootstrap registers
constexpr std::uint32_t kControlBits = 3;

}  // namespace

GigeCamera::GigeCamera(CameraAddress address, CameraSettings settings)
    : address_(std::move(address)),
      name_(address_.name),
      host_(address_.address),
      settings_(std::move(settings)),
      thread_([this] { run(); }) {}

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
  bury();
  auto device = AravisDevice::open(address_);
  if (!device) return tl::unexpected(device.error());
  device_ = std::move(*device);
  address_.serial = device_->serial();
  Result<> ok = device_->apply(settings_);
  if (!ok) device_.reset();
  return ok;
}

// Closing a connection to a camera that does not answer takes seconds.
void GigeCamera::bury() {
  std::erase_if(graves_,
                [](auto& grave) { return grave.wait_for(milliseconds(0)) == std::future_status::ready; });
  if (!device_) return;
  std::shared_ptr<AravisDevice> dead = std::move(device_);
  graves_.push_back(std::async(std::launch::async, [dead]() mutable { dead.reset(); }));
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
    loss_told_ = is_recovering_ = false;
    set_problem({});
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
    if (!device_) return unavailable(concat("camera ", name_), "is not open", "open it first");
    auto ok = device_->start();
    is_streaming_ = is_armed_ && ok;
    return ok;
  });
}

std::future<Result<FrameShape>> GigeCamera::shape() {
  return post([this]() -> Result<FrameShape> {
    if (!device_) return unavailable(concat("camera ", name_), "is not open", "open it first");
    return device_->shape();
  });
}

std::future<Result<>> GigeCamera::set_frame_delay(std::int64_t delay_ns) {
  return post([this, delay_ns]() -> Result<> {
    address_.frame_delay_ns = delay_ns;  // also when it is opened again
    return device_ ? device_->set_frame_delay(delay_ns) : Result<>();
  });
}

std::future<std::optional<SharedClock>> GigeCamera::shared_clock() {
  return post([this] { return device_ ? device_->shared_clock() : std::nullopt; });
}

std::future<Result<>> GigeCamera::software_trigger() {
  return post([this]() -> Result<> {
    if (!device_) return unavailable(concat("camera ", name_), "is not open", "open it first");
    return device_->software_trigger();
  });
}

std::future<StreamStatistics> GigeCamera::stop(bool answers) {
  return post([this, answers]() -> StreamStatistics {
    if (!is_armed_) return {};
    if (is_streaming_ && answers && device_ && !device_->is_lost()) {
      device_->stop();
      const auto end = std::chrono::steady_clock::now() + kLastFrames;
      while (std::chrono::steady_clock::now() < end) deliver(kRequestLatency);
    }
    is_armed_ = is_streaming_ = is_recovering_ = false;
    events_ = {};
    return device_ ? device_->close_stream() : StreamStatistics{};
  });
}

void GigeCamera::probe() {
  post([this] {
    if (is_streaming_) events_.on_answer(answers_discovery(address_.address, kProbeTimeout));
  });
}

void GigeCamera::recover() {
  post([this] {
    if (!is_armed_ || is_recovering_) return;
    is_recovering_ = true;
    next_try_ = steady_clock::now();
    give_up_stream_ = next_try_ + kSilentStream;
  });
}

void GigeCamera::set_problem(std::string text) {
  const std::lock_guard lock(mutex_);
  problem_ = std::move(text);
}

std::string GigeCamera::problem() const {
  const std::lock_guard lock(mutex_);
  return problem_;
}

void GigeCamera::try_recover() {
  next_try_ = steady_clock::now() + kRetry;
  const auto found = discover_at(address_.address, kProbeTimeout);
  if (!found) {
    give_up_stream_ = steady_clock::now() + kSilentStream;
    return set_problem("it does not answer");
  }
  if (found->serial != address_.serial) {
    return set_problem(
        concat("serial number ", found->serial, " answers in its place, not ", address_.serial));
  }
  const auto control = read_bootstrap_register(address_.address, kControlPrivilege, kProbeTimeout);
  if (!control) return;
  const bool is_held = (*control & kControlBits) != 0;
  // Ours still, as far as the camera knows: its frames will come, or its stream is broken.
  const bool is_ours = is_held && device_ && !device_->is_lost();
  if (is_ours && steady_clock::now() < give_up_stream_) return;
  if (is_held && !is_ours) return set_problem("another program has control of it");
  const Result<> ok = rejoin();
  if (!ok) return set_problem(ok.error().message);
  set_problem({});
  is_recovering_ = false;
  events_.on_rejoin();
}

Result<> GigeCamera::rejoin() {
  Result<> ok = open_now();
  if (ok) ok = device_->open_stream();
  if (ok) ok = device_->start();
  loss_told_ = false;
  return ok;
}

void GigeCamera::deliver(milliseconds timeout) {
  if (is_recovering_ && steady_clock::now() >= next_try_) try_recover();
  if (!device_) {  // between two tries
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, timeout, [this] { return quit_ || !requests_.empty(); });
    return;
  }
  if (device_->is_lost() && !loss_told_) {
    loss_told_ = true;
    events_.on_camera_lost();
  }
  auto next = device_->next(timeout);
  if (!next) return;
  if (auto* arrival = std::get_if<Arrival>(&*next)) {
    is_recovering_ = false;
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
  if (is_streaming_ && device_ && !device_->is_lost()) device_->stop();
  device_.reset();
}

}  // namespace flamefield
