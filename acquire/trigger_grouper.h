#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "acquire/arrival.h"
#include "acquire/camera_clock.h"
#include "acquire/pulse_train.h"
#include "proto/frame.h"

namespace flamefield {

struct GrouperOptions {
  std::vector<std::string> cameras;  // names, in the order of the rig
  std::string capture;
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses = 0;                       // later ones are not wanted; 0: endless
  std::int64_t first_count = 0;                  // trigger count before pulse 1
  std::int64_t deadline_ns = 1'000'000'000;      // a set waits at most this long after its first sign
  std::int64_t least_patience_ns = 150'000'000;  // for stragglers when most are there; else one period
  std::int64_t overdue_ns = 100'000'000;  // after the others, when a camera should be asked whether it lives
  std::int64_t silence_ns = 100'000'000;  // no frame of two pulses, the second that old: the camera is lost
  std::int64_t max_jump = 10'000;         // pulses between two signs of life; more is not believed
};

inline constexpr std::size_t kLossCauses = 7;  // of LossCause

// Where every frame of one camera went:
//   frames_in = delivered + late + duplicates + unwanted + before_start + implausible + extra + still waiting
//   pulses of the capture = delivered + sum of losses
struct CameraTally {
  std::int64_t frames_in = 0;
  std::int64_t delivered = 0;
  std::int64_t late = 0;                              // its set was already out
  std::int64_t duplicates = 0;                        // its set already had one
  std::int64_t unwanted = 0;                          // after the last pulse of the capture
  std::int64_t before_start = 0;                      // pulse before the capture began
  std::int64_t implausible = 0;                       // trigger count out of all reason
  std::int64_t extra = 0;                             // of an edge that no other camera saw
  std::int64_t unplaced = 0;                          // buffers that failed without leaving a gap
  std::int64_t count_slips = 0;                       // its counter missed edges or saw too many
  std::array<std::int64_t, kLossCauses> losses = {};  // by LossCause
};

// Puts the frames of one pulse together. A frame's pulse is what its camera's trigger counter says, as long
// as its time, put on the array's common time by a clock fitted to each camera, agrees: a counter that took
// noise for an edge, or overlooked one, is outvoted by the times of the other cameras, and set right. Cameras
// without a counter go by time alone; after a restart, until the counter is understood again, all do.
//
// Sets come out in pulse order, one for every pulse that any camera noticed, as soon as nothing more can
// come: all cameras delivered, or have moved on to later pulses (each delivers in order), or are lost; once
// most are there at the latest one period later; else at the deadline. A function of its inputs: no threads,
// no clock; `now_ns` may be any clock that never goes back, and stamps the sets.
class TriggerGrouper {
 public:
  explicit TriggerGrouper(GrouperOptions options);

  // Each returns the sets that this made complete, in pulse order.
  std::vector<FrameSet> add(std::size_t camera, Arrival arrival, std::int64_t now_ns);
  // A buffer of the camera failed; which pulse it was for shows only later.
  std::vector<FrameSet> lose(std::size_t camera, LossCause cause, std::int64_t now_ns);
  std::vector<FrameSet> lose_camera(std::size_t camera, std::int64_t now_ns);
  // The camera was started again: its counter and clock mean something else from now on.
  void rejoin(std::size_t camera);
  std::vector<FrameSet> advance(std::int64_t now_ns);
  // Cameras that the oldest set waits for while most are there, each named once a pulse.
  std::vector<std::size_t> take_overdue(std::int64_t now_ns);
  // Such a camera is alive: whatever it owes, it has missed.
  void answered(std::size_t camera) { states_[camera].answered_pulse = next_pulse_ - 1; }
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
  double drift_ppm(std::size_t camera) const { return states_[camera].clock.drift_ppm(); }
  // The pulse that a camera's counter means; none: not known since it started again.
  std::optional<std::int64_t> pulse_of_count(std::size_t camera, std::int64_t count) const;

 private:
  struct Entry {
    Arrival arrival;
    std::int64_t common_ns = 0;
    bool is_trusted = false;        // its time may contradict a counter
    std::int64_t tolerance_ns = 0;  // by how little it must agree with others to do so
  };
  struct OpenSet {
    std::int64_t pulse = 0;
    std::int64_t opened_ns = 0;
    std::size_t filled = 0;
    std::vector<std::optional<Entry>> entries;  // one per camera
  };
  struct PendingLoss {
    LossCause cause{};
    std::int64_t after_pulse = 0;  // the camera's latest frame when it happened
  };
  struct CameraState {
    CameraClock clock;
    std::optional<std::int64_t> base;  // trigger count before pulse 1; none: to be found by time
    std::int64_t last_pulse = 0;       // of the latest frame
    std::int64_t last_closed = 0;      // of the latest frame that went out
    std::int64_t joined_pulse = 0;     // the newest one when it was started again
    std::int64_t asked_pulse = 0;      // for which it was overdue last
    std::int64_t answered_pulse = 0;   // newest pulse when it was known to be alive
    bool is_lost = false;
    std::deque<PendingLoss> pending;
  };
  enum class Fate { Placed, Late, Duplicate, Unwanted, BeforeStart, Implausible, Extra };

  Fate place(std::size_t camera, Entry entry, std::int64_t now_ns);
  std::optional<std::int64_t> pulse_by_count(const Entry& entry, std::int64_t pulse) const;
  std::optional<std::int64_t> pulse_by_time(const Entry& entry) const;
  Fate insert(std::size_t camera, Entry entry, std::int64_t pulse, std::int64_t now_ns);
  void count(std::size_t camera, Fate fate);

  PulseTrain::Entry agreed_time(const OpenSet& set) const;
  void review(std::int64_t pulse, std::int64_t now_ns);
  void correct(std::size_t camera, std::int64_t from_pulse, std::int64_t now_ns);

  OpenSet* open_set(std::int64_t pulse);
  bool open_until(std::int64_t pulse, std::int64_t now_ns);
  void pop_back();
  std::int64_t patience_ns(const OpenSet& set) const;
  std::optional<std::int64_t> silence_due_ns(std::size_t camera) const;
  void give_up_silent_cameras(std::int64_t now_ns);
  bool is_owed(std::size_t camera, std::int64_t pulse) const;
  bool can_close(const OpenSet& set, std::int64_t now_ns) const;
  bool is_overdue(std::size_t camera) const;
  bool is_dubious(const OpenSet& set) const;
  bool is_nobodys_pulse(const OpenSet& set) const;
  void drop_front();
  LossCause cause_of_gap(std::size_t camera, std::int64_t pulse, bool is_final);
  FrameSet close_front(std::int64_t now_ns, bool is_final);
  std::vector<FrameSet> close_ready(std::int64_t now_ns);

  const GrouperOptions options_;
  std::int64_t last_wanted_;  // pulse
  std::int64_t next_pulse_ = 1;
  std::deque<OpenSet> open_;
  std::deque<std::int64_t> recent_;  // when the latest sets were opened, by pulse, up to next_pulse_
  PulseTrain train_;
  bool has_counters_ = false;  // some camera counts: numbers are more than an order
  bool is_ending_ = false;     // no pulse will come any more
  int corrections_ = 0;        // under way, one inside the other
  std::vector<CameraState> states_;
  std::vector<CameraTally> tallies_;
};

}  // namespace flamefield
