#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "proto/frame.h"

// How the camera array is asked to take pictures, and what it says of itself.
namespace flamefield {

struct StartCapture {  // -> CaptureState, once every camera is armed
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses = 0;  // 0: until stopped
  std::string id;           // empty: named by time and kind
};
struct StopCapture {};  // -> CaptureState, once every set is stored: stopping drains, it never discards
struct GetCapture {};   // -> CaptureState
struct GetPreview {     // -> SetData with the newest frame of one camera
  std::string camera;
};

enum class CapturePhase { Idle, Armed, Draining };
std::string_view name_of(CapturePhase phase);

struct CaptureState {
  struct CameraState {
    std::string name;
    std::string address;
    bool connected = false;
    std::int64_t frames = 0;                     // of this capture
    std::map<std::string, std::int64_t> losses;  // by cause
    double newest_age_s = -1;                    // -1: no frame yet
  };
  CapturePhase phase = CapturePhase::Idle;
  std::string id;  // of the running capture, else of the last one; empty: none yet
  CaptureKind kind = CaptureKind::Burst;
  std::int64_t pulses_wanted = 0;  // 0: until stopped
  std::int64_t sets = 0;           // assembled
  std::int64_t sets_stored = 0;    // acknowledged as durable
  std::vector<CameraState> cameras;
};

}  // namespace flamefield
