#pragma once

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "acquire/action_trigger.h"
#include "acquire/bandwidth_plan.h"
#include "acquire/gige_camera.h"
#include "acquire/settings.h"
#include "acquire/trigger_grouper.h"
#include "proto/error.h"
#include "proto/frame.h"

namespace flamefield {

struct CaptureOptions {
  std::string capture = {};  // its id, e.g. "20260301T101500-burst"
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses = 0;              // 0: endless, until stop()
  std::int64_t set_deadline_ms = 1000;  // a set waits at most this long for its last frame
};

// The receipt of one camera: pulses of the capture = tally.delivered + sum of tally.losses.
struct CameraReceipt {
  std::string camera;
  CameraTally tally;
  StreamStatistics stream;
  bool is_lost = false;      // at the end of the capture
  std::int64_t rejoins = 0;  // it was opened anew and went on
  double drift_ppm = 0;      // of its clock against the array's
};

struct CaptureReport {
  std::string capture;
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses = 0;         // seen by any camera, or counted at the end
  std::int64_t complete_sets = 0;  // without a loss; all sets: one a pulse
  std::vector<CameraReceipt> cameras;
};

struct CaptureProgress {
  std::int64_t pulses_seen = 0;
  std::int64_t sets = 0;
  std::int64_t complete_sets = 0;
  std::vector<std::string> lost_cameras;
  std::vector<CameraTally> tallies;   // by camera
  std::vector<std::int64_t> rejoins;  // by camera
  std::vector<std::string> problems;  // by camera: why a lost one is not back; empty: nothing known
};

// The ring: all cameras opened, set alike, and captured together, again and again.
class CameraArray {
 public:
  using SetHandler = std::function<void(FrameSet)>;

  // Opens all cameras at the same time. The error names every camera that did not open.
  static Result<std::unique_ptr<CameraArray>> open(const std::vector<CameraAddress>& addresses,
                                                   const CameraSettings& settings);
  ~CameraArray();
  CameraArray(const CameraArray&) = delete;
  CameraArray& operator=(const CameraArray&) = delete;

  // New settings for all cameras, between captures.
  Result<> apply(const CameraSettings& settings);

  // Arms all cameras: every pulse after this returned is delivered as a set or named as a loss in one.
  // Pulses that come while arming belong to no capture. `on_set` is called from one thread, in pulse order;
  // cameras go on while it works. Unavailable: a camera does not answer (it is opened anew if it is back).
  Result<> start(const CaptureOptions& options, SetHandler on_set);

  // True once `pulses` sets are out; false: not within the timeout, or the capture is endless.
  bool wait_done(std::chrono::milliseconds timeout);

  // Ends the capture: waits until each pulse triggered before this call is out as a set. Never discards.
  CaptureReport stop();

  // Triggers every camera by software, one after the other.
  Result<> software_trigger();

  // Gives each camera its place in the burst after a pulse, from what the cameras say that they send. The
  // needs' cameras, size and payload are filled in. Between captures. InvalidInput: it does not fit.
  Result<BandwidthPlan> share_link(BandwidthNeeds needs);

  // The clock that all cameras keep by PTP, as it was when they were armed; none: not all of them do.
  std::optional<SharedClock> common_clock();

  CaptureProgress progress() const;
  std::vector<std::string> names() const;
  std::vector<std::string> addresses() const;

 private:
  struct Lost {};
  struct Alive {};
  struct Rejoined {};
  struct Input {
    std::size_t camera = 0;
    std::variant<Arrival, LossCause, Lost, Alive, Rejoined> what;
  };

  CameraArray() = default;
  GigeCamera::Events events_of(std::size_t camera);
  Result<std::int64_t> agree_on_count();
  std::vector<std::optional<std::int64_t>> trigger_counts();
  std::optional<std::int64_t> last_fired_pulse();
  void look_after_silent_cameras();
  void push(Input input);
  void run();
  void feed(Input input, std::vector<FrameSet>& sets);

  std::vector<std::unique_ptr<GigeCamera>> cameras_;

  mutable std::mutex mutex_;  // what follows
  std::condition_variable wake_;
  mutable std::condition_variable changed_;
  std::deque<Input> inputs_;
  std::optional<TriggerGrouper> grouper_;
  CaptureOptions options_;
  SetHandler on_set_;
  std::vector<bool> is_looked_for_;  // lost cameras that were told to recover
  std::vector<std::int64_t> rejoins_;
  std::int64_t first_count_ = 0;
  std::int64_t sets_handled_ = 0;
  std::int64_t complete_sets_ = 0;
  std::optional<std::int64_t> end_request_;  // last pulse, for the grouper's thread
  bool flush_request_ = false;
  bool is_capturing_ = false;
  bool is_drained_ = false;
  std::thread thread_;
};

}  // namespace flamefield
