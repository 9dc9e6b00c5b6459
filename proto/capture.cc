#include "proto/capture.h"

#include <array>
#include <utility>

namespace flamefield {

std::string_view name_of(CapturePhase phase) {
  switch (phase) {
    case CapturePhase::Idle:
      return "idle";
    case CapturePhase::Standby:
      return "standby";
    case CapturePhase::Armed:
      return "armed";
    case CapturePhase::Draining:
      return "draining";
  }
  return "unknown";
}

namespace {

constexpr std::array<std::pair<CaptureEnd, std::string_view>, 5> kEnds = {
    {{CaptureEnd::None, "none"},
     {CaptureEnd::Complete, "complete"},
     {CaptureEnd::Stopped, "stopped"},
     {CaptureEnd::Storage, "storage"},
     {CaptureEnd::Interrupted, "interrupted"}}};

}  // namespace

std::string_view name_of(CaptureEnd end) {
  for (const auto& [value, name] : kEnds) {
    if (value == end) return name;
  }
  return "unknown";
}

std::optional<CaptureEnd> capture_end_from_name(std::string_view name) {
  for (const auto& [value, text] : kEnds) {
    if (text == name) return value;
  }
  return std::nullopt;
}

}  // namespace flamefield
