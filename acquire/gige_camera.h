#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

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
    std::function<void(bool)> on_answer;   // to probe(): whether the camera is alive
    std::function<void()> on_rejoin;       // it was opened anew and streams again: counter and clock are new
  };

  GigeCamera(CameraAddress address, CameraSettings settings);
  ~GigeCamera();  // may wait some seconds for a camera that no longer answers
  GigeCamera(const GigeCamera&) = delete;
  GigeCamera& operator=(const GigeCamera&) = delete;

  const std::string& name() const { return name_; }
  const std::string& address() const { return host_; }

  std::future<Result<>> open();
  // Settings from the next arm() on.
  std::future<Result<>> apply(CameraSettings settings);
  // A new stream, its events wired; opens the camera again if it was lost.
  std::future<Result<>> arm(Events events);
  std::future<bool> reset_trigger_count();
  std::future<std::optional<std::int64_t>> trigger_count();
  std::future<Result<>> start();
  // What the camera sends with its present settings.
  std::future<Result<FrameShape>> shape();
  std::future<Result<>> set_frame_delay(std::int64_t delay_ns);
  std::future<std::optional<SharedClock>> shared_clock();  // once armed
  std::future<Result<>> software_trigger();
  // Delivers what is still in the buffers, then closes the stream. A camera that does not answer any more is
  // left alone: each question to it would take seconds.
  std::future<StreamStatistics> stop(bool answers = true);
  // Asks the camera, past Aravis, whether it is there.
  void probe();
  // The camera has gone silent: looks for it until it delivers again. One that has forgotten us (it was
  // without power, or cut off for longer than its heartbeat) is opened anew, set and read back as before, and
  // started; only with the serial number that it had. What is left of the old connection dies in the
  // background.
  void recover();
  // Why the camera is not back yet; empty: nothing is known against it.
  std::string problem() const;
  // Ends the thread once its requests are done, without waiting for it.
  void begin_close();

 private:
  template <class Function>
  auto post(Function function) -> std::future<decltype(function())>;
  Result<> open_now();
  void bury();
  void try_recover();
  Result<> rejoin();
  void set_problem(std::string text);
  void run();
  void deliver(std::chrono::milliseconds timeout);

  CameraAddress address_;  // with the serial number, once it is known; the thread's own
  const std::string name_, host_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::function<void()>> requests_;
  bool quit_ = false;
  std::string problem_;

  // The thread's own.
  CameraSettings settings_;
  std::unique_ptr<AravisDevice> device_;
  Events events_;
  bool is_armed_ = false;      // there is a stream
  bool is_streaming_ = false;  // and it delivers
  bool loss_told_ = false;
  bool is_recovering_ = false;
  std::chrono::steady_clock::time_point next_try_, give_up_stream_;
  std::vector<std::future<void>> graves_;  // old connections, each waiting for a camera that is gone

  std::thread thread_;
};

}  // namespace flamefield
