#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "acquire/camera_array.h"
#include "proto/message.h"
#include "services/acquisition/hooks.h"
#include "services/acquisition/outbox.h"
#include "services/bus/bus.h"

namespace flamefield {

struct AcquisitionOptions {
  std::vector<CameraAddress> cameras;
  CameraSettings settings;
  std::vector<std::string> endpoints = {"inproc://acquisition"};  // where captures are asked for
  std::string dispatcher_endpoint = "inproc://dispatcher";
  CaptureHooks hooks;
  // Sets that may wait for a slow or full disk before a capture is stopped, loudly; all of them are kept.
  std::int64_t most_waiting_sets = 200;
};

// The camera array as a service: arms and captures on request, and hands every set to the dispatcher.
// Stopping a capture, or the service, drains: sets that exist are stored first.
class Acquisition {
 public:
  // Opens all cameras and binds the endpoints. Unavailable: a camera does not answer, an endpoint is in use.
  static Result<std::unique_ptr<Acquisition>> open(Bus& bus, AcquisitionOptions options);

  // Until stopped. Unavailable: the dispatcher's endpoint cannot be used.
  Result<> run(std::stop_token stop);

  // What GetCapture and GetPreview answer; safe from any thread.
  CaptureState state() const;
  std::optional<Frame> newest_frame(const std::string& camera) const;

  // How long ago run() last went round; for a watchdog.
  std::chrono::steady_clock::duration silence() const {
    return std::chrono::steady_clock::now().time_since_epoch() - beat_.load();
  }

 private:
  Acquisition(Bus& bus, AcquisitionOptions options);
  Message answer(const Message& question, std::stop_token stop);
  Message start(const StartCapture& request, std::stop_token stop);
  Message preview(const GetPreview& request) const;
  void on_set(FrameSet set);
  void finish(std::stop_token stop);
  bool tell_dispatcher(const PutCapture& capture, std::stop_token stop);

  Bus& bus_;
  const AcquisitionOptions options_;
  std::unique_ptr<CameraArray> array_;
  std::unique_ptr<Router> router_;
  Outbox outbox_;
  std::atomic<std::chrono::steady_clock::duration> beat_{std::chrono::steady_clock::now().time_since_epoch()};
  PutCapture capture_;  // the running one, else the last

  mutable std::mutex mutex_;  // what follows
  CaptureState state_;
  std::map<std::string, Frame> newest_;
};

}  // namespace flamefield
