#pragma once

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "acquire/aravis_device.h"
#include "acquire/arrival.h"
#include "acquire/settings.h"

namespace flamefield {

// One camera and the one thread that ever touches it. Requests queue up for that thread and answer through
// futures, so that many cameras open, start and die at the same time.
class GigeCamera {
 public:
  // Called from the camera's thread; they must return at once.
  struct Events {
    std::function<void(Arrival)> on_frame;
    std::function<void(LossCause)> on_loss;
    std::function<void()> on_camera_lost;  // once a stream
  };

  GigeCamera(CameraAddress address, CameraSettings settings);
  ~GigeCamera();  // may wait some seconds for a camera that no longer answers
  GigeCamera(const GigeCamera&) = delete;
  GigeCamera& operator=(const GigeCamera&) = delete;

  const CameraAddress& address() const { return address_; }

  std::future<Result<>> open();
  // Settings from the next arm() on.
  std::future<Result<>> apply(CameraSettings settings);
  // A new stream, its events wired; opens the camera again if it was lost.
  std::future<Result<>> arm(Events events);
  std::future<bool> reset_trigger_count();
  std::future<std::optional<std::int64_t>> trigger_count();
  std::future<Result<>> start();
  std::future<Result<>> software_trigger();
  // Delivers what is still in the buffers, then closes the stream. A camera that does not answer any more is
  // left alone: each question to it would take seconds.
  std::future<StreamStatistics> stop(bool answers = true);
  // Ends the thread once its requests are done, without waiting for it.
  void begin_close();

 private:
  template <class Function>
  auto post(Function function) -> std::future<decltype(function())>;
  Result<> open_now();
  void run();
  void deliver(std::chrono::milliseconds timeout);

  const CameraAddress address_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> requests_;
  bool quit_ = false;

  // The thread's own.
  CameraSettings settings_;
  std::unique_ptr<AravisDevice> device_;
  Events events_;
  bool is_armed_ = false;      // there is a stream
  bool is_streaming_ = false;  // and it delivers
  bool loss_told_ = false;

  std::thread thread_;
};

}  // namespace flamefield
