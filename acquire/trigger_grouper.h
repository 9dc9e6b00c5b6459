#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "acquire/arrival.h"
#include "proto/frame.h"

namespace flamefield {

struct GrouperOptions {
  std::vector<std::string> cameras;  // names, in the order of the rig
  std::string capture;
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses = 0;                   // later ones are not wanted; 0: endless
  std::int64_t first_count = 0;              // trigger count before pulse 1
  std::int64_t deadline_ns = 1'000'000'000;  // a set waits at most this long after its first sign
  std::int64_t silence_ns = 800'000'000;     // and a camera is given up after this long without a frame
  std::int64_t silent_pulses = 3;            // while this many more pulses came, or sets passed without it
  std::int64_t max_jump = 10'000;            // pulses between two signs of life; more is not believed
};

inline constexpr std::size_t kLossCauses = 6;  // of LossCause

// Where every frame of one camera went:
//   frames_in = delivered + late + duplicates + unwanted + before_start + implausible + still waiting
//   pulses of the capture = delivered + sum of losses
struct CameraTally {
  std::int64_t frames_in = 0;
  std::int64_t delivered = 0;
  std::int64_t late = 0;                              // its set was already out
  std::int64_t duplicates = 0;                        // its set already had one
  std::int64_t unwanted = 0;                          // after the last pulse of the capture
  std::int64_t before_start = 0;                      // pulse before the capture began
  std::int64_t implausible = 0;                       // trigger count out of all reason
  std::int64_t unplaced = 0;                          // buffers that failed without leaving a gap
  std::array<std::int64_t, kLossCauses> losses = {};  // by LossCause
};

// Puts the frames of one pulse together. Pulses are told apart by the cameras' trigger counters; a frame
// without one joins the pulse nearest in time. Sets come out in pulse order, one for every pulse that any
// camera noticed, as soon as nothing more can come: all cameras delivered, or have moved on to later pulses
// (each delivers in order), or are lost; at the latest at the deadline. A function of its inputs: no
// threads, no clock; `now_ns` may be any clock that never goes back, and stamps the sets.
class TriggerGrouper {
 public:
  explicit TriggerGrouper(GrouperOptions options);

  // Each returns the sets that this made complete, in pulse order.
  std::vector<FrameSet> add(std::size_t camera, Arrival arrival, std::int64_t now_ns);
  // A buffer of the camera failed; which pulse it was for shows only later.
  std::vector<FrameSet> lose(std::size_t camera, LossCause cause, std::int64_t now_ns);
  std::vector<FrameSet> lose_camera(std::size_t camera, std::int64_t now_ns);
  std::vector<FrameSet> advance(std::int64_t now_ns);
  // The capture ends with pulse `last_pulse`, all of which were fired: sets are owed for each, none after it.
  std::vector<FrameSet> end_at(std::int64_t last_pulse, std::int64_t now_ns);
  // Nothing more will come.
  std::vector<FrameSet> flush(std::int64_t now_ns);

  // When advance() is due; none: nothing waits.
  std::optional<std::int64_t> next_deadline_ns() const;
  bool has_open_sets() const { return !open_.empty(); }
  bool is_lost(std::size_t camera) const { return states_[camera].is_lost; }
  std::int64_t pulses_seen() const { return next_pulse_ - 1; }
  std::int64_t sets_out() const { return next_pulse_ - 1 - static_cast<std::int64_t>(open_.size()); }
  const std::vector<CameraTally>& tallies() const { return tallies_; }

 private:
  struct OpenSet {
    std::int64_t pulse = 0;
    std::int64_t opened_ns = 0;
    std::size_t filled = 0;
    bool is_checked = false;                       // for silent cameras
    std::vector<std::optional<Arrival>> arrivals;  // one per camera
  };
  struct PendingLoss {
    LossCause cause{};
    std::int64_t after_pulse = 0;  // the camera's latest frame when it happened
  };
  struct CameraState {
    std::int64_t last_pulse = 0;
    std::int64_t late_sets = 0;  // in a row
    bool is_lost = false;
    std::deque<PendingLoss> pending;
  };
  struct PulseTime {
    std::int64_t pulse = 0, time_ns = 0;
  };

  std::optional<std::int64_t> pulse_of(const Arrival& arrival) const;
  bool open_until(std::int64_t pulse, std::int64_t now_ns);
  void remember_time(std::int64_t pulse, std::int64_t time_ns);
  void give_up_silent_cameras(std::int64_t now_ns);
  bool can_close(const OpenSet& set, std::int64_t now_ns) const;
  LossCause cause_of_gap(std::size_t camera, std::int64_t pulse, bool is_final);
  FrameSet close_front(std::int64_t now_ns, bool is_final);
  std::vector<FrameSet> close_ready(std::int64_t now_ns);

  const GrouperOptions options_;
  std::int64_t last_wanted_;  // pulse
  std::int64_t next_pulse_ = 1;
  std::deque<OpenSet> open_;
  std::deque<PulseTime> times_;  // of recent pulses, for frames without a count
  std::vector<CameraState> states_;
  std::vector<CameraTally> tallies_;
};

}  // namespace flamefield
