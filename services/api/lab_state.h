#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "proto/capture.h"
#include "proto/message.h"

namespace flamefield {

// What the live page must know at one moment.
struct LabState {
  std::int64_t time_ns = 0;           // UTC, when it was put together
  std::optional<CaptureState> array;  // none: it does not answer
  std::optional<Status> dispatcher;   // likewise
  std::int64_t volumes = 0;           // of single sets of the array's capture
  std::string newest_run;             // empty: none yet
  double sets_per_s = 0;              // lately
  double free_bytes = -1;             // where the data lie; -1: not known
  double bytes_per_set = 0;           // frames and volume
  std::string report;                 // link; empty: none
};

struct Alarm {
  bool is_severe = false;  // data are being lost, or will be
  std::string what;        // stable key, e.g. "camera-lost"
  std::string text;
};

// Severe ones first.
std::vector<Alarm> alarms_of(const LabState& state);

// How long the disk lasts at the present rate; none while nothing is recorded.
std::optional<double> seconds_to_full(const LabState& state);

nlohmann::ordered_json json_of(const LabState& state);

}  // namespace flamefield
