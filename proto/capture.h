#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/frame.h"

// How the camera array is asked to take pictures, and what it says of itself.
namespace flamefield {

struct StartCapture {  // -> CaptureState, once every camera is armed
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses = 0;      // 0: until stopped
  std::string id = {};          // empty: named by time and kind
  std::int64_t pre_pulses = 0;  // the last ones before the request, which standby has kept, are stored too
  bool store = true;            // false: only shown (GetPreview), nothing lasts
};
struct StandBy {};  // -> CaptureState; the array sees every pulse and keeps the last ones in memory
// -> CaptureState, once every set is stored: stopping drains, it never discards. Ends standby when nothing is
// being captured. While the disk refuses, the answer comes early, in phase Draining.
struct StopCapture {};
struct GetCapture {};  // -> CaptureState
struct GetPreview {    // -> SetData with the newest frame of one camera, or of each
  std::string camera;  // empty: all; times, pulse and losses are then those of the newest set
};

enum class CapturePhase { Idle, Standby, Armed, Draining };
std::string_view name_of(CapturePhase phase);
inline bool is_capturing(CapturePhase phase) {
  return phase == CapturePhase::Armed || phase == CapturePhase::Draining;
}

// How a capture came to its end.
enum class CaptureEnd {
  None,         // still running
  Complete,     // every pulse that was asked for
  Stopped,      // on request
  Storage,      // sets came faster than they could be stored; those made until then are all kept
  Interrupted,  // the capturing program ended without closing it; what was not stored by then is lost
};
std::string_view name_of(CaptureEnd end);
std::optional<CaptureEnd> capture_end_from_name(std::string_view name);

// What the array counted of one camera in one capture: frames_in = delivered + the counters of frames that
// came and are in no set; pulses = delivered + losses.
struct CameraAccount {
  std::string camera;
  std::int64_t frames_in = 0;
  std::int64_t delivered = 0;                  // in sets
  std::map<std::string, std::int64_t> losses;  // by cause
  // Frames in no set: late, duplicate, unwanted, before-start, implausible, extra. And what else happened:
  // count-slip, failed-buffer, rejoin, packet-resent, underrun.
  std::map<std::string, std::int64_t> counters = {};
};

struct CaptureState {
  struct CameraState {
    std::string name;
    std::string address;
    bool connected = false;
    std::int64_t frames = 0;                            // of this capture
    std::map<std::string, std::int64_t> losses;         // by cause
    double newest_age_s = -1;                           // -1: no frame yet
    std::map<std::string, std::int64_t> counters = {};  // as in CameraAccount, of this capture
  };
  CapturePhase phase = CapturePhase::Idle;
  std::string id;  // of the running capture, else of the last one; empty: none yet
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses_wanted = 0;  // 0: until stopped
  std::int64_t sets = 0;           // assembled
  std::int64_t sets_stored = 0;    // acknowledged as durable
  std::vector<CameraState> cameras;
  std::int64_t pre_pulses = 0;        // of the sets: from before the request
  std::int64_t sets_held = 0;         // in standby's memory
  std::int64_t previews_skipped = 0;  // frames that no preview showed, so that recording goes first
  std::string trouble = {};           // what is wrong with storing, or ended the capture; empty: nothing
};

}  // namespace flamefield
