#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "acquire/action_trigger.h"
#include "acquire/bandwidth_plan.h"
#include "acquire/camera_array.h"
#include "proto/message.h"
#include "services/acquisition/history.h"
#include "services/acquisition/hooks.h"
#include "services/acquisition/journal.h"
#include "services/acquisition/outbox.h"
#include "services/acquisition/previews.h"
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
  HistoryLimits history = {};  // of standby
  // What lies between the cameras and here. Each camera gets its place in a plan with what it really sends.
  // None: cameras send at once.
  std::optional<BandwidthNeeds> network = std::nullopt;
  // Pulses a second that this program fires itself, with action commands (settings.action); 0: something else
  // triggers the cameras.
  double action_rate_hz = 0;
  std::filesystem::path journal = {};  // file that tells the next program of a capture left open; empty: none
  // How long to wait for cameras that another program still holds: one that was killed, say.
  std::chrono::milliseconds open_patience{0};
};

// The camera array as a service: arms and captures on request, and hands every set to the dispatcher.
// Stopping a capture, or the service, drains: sets that exist are stored first.
class Acquisition {
 public:
  // Opens all cameras and binds the endpoints. Unavailable: a camera does not answer, an endpoint is in use.
  // InvalidInput: what the cameras send at this rate does not fit through the network.
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
  using Clock = std::chrono::steady_clock;
  struct Asker {  // waits for the end of a capture
    std::string peer;
    std::uint64_t request = 0;
    Clock::time_point since;
  };

  Acquisition(Bus& bus, AcquisitionOptions options, CaptureJournal journal);
  Result<> open_cameras();
  Result<> plan_network();

  // The service's thread.
  void beat() { beat_ = Clock::now().time_since_epoch(); }
  void serve_requests();
  std::optional<Message> answer(const Delivery& delivery);
  Message preview(const GetPreview& request);
  void follow_capture(bool is_stopping);
  void answer_askers();
  bool tell_dispatcher(const PutCapture& capture, std::chrono::milliseconds patience);
  void close_left_behind();

  // acquisition_capture.cc: the life of a capture.
  Message start(const StartCapture& request);
  Message show(const StartCapture& request);
  Message stand_by();
  Result<> arm(const CaptureOptions& options);
  void disarm();
  void begin(const StartCapture& request);
  void begin_state(const StartCapture& request, const std::string& id);
  void note(const PutCapture& capture);
  bool has_all_pulses() const;
  void end_capture(CaptureEnd end, const std::string& reason);
  void close_capture();
  CapturePhase phase() const;

  // The array's thread.
  void on_set(FrameSet set);
  void keep(FrameSet set);  // with mutex_ held: the set belongs to the capture
  void take_accounts();     // with mutex_ held: capture_ says what was seen until now

  Bus& bus_;
  const AcquisitionOptions options_;
  std::unique_ptr<CameraArray> array_;
  std::unique_ptr<ActionTrigger> action_trigger_;
  std::unique_ptr<Router> router_;
  Outbox outbox_;
  std::atomic<Clock::duration> beat_{Clock::now().time_since_epoch()};
  std::vector<Asker> askers_;
  bool stands_by_ = false;  // comes back to standby after a capture
  bool is_armed_ = false;   // the array is capturing, for a capture or for standby
  Clock::time_point next_report_{};

  mutable std::mutex mutex_;  // what follows
  CaptureState state_;
  bool shows_only_ = false;  // armed without a capture: pictures for previews
  PutCapture capture_;       // the running one, else the last
  CaptureJournal journal_;
  SetHistory history_;
  Previews previews_;
  std::int64_t pulses_seen_ = 0;                // by the array since it was armed
  std::int64_t pulse_base_ = 0;                 // of these, before pulse 1 of the capture
  std::int64_t sets_before_ = 0;                // of the capture: from standby's memory
  std::vector<CameraReceipt> receipts_before_;  // what the array had counted when the capture began
};

}  // namespace flamefield
