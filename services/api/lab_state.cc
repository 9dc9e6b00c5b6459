#include "services/api/lab_state.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "services/api/records_json.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;

std::int64_t lost_frames(const CaptureState::CameraState& camera) {
  std::int64_t lost = 0;
  for (const auto& [cause, count] : camera.losses) lost += count;
  return lost;
}

std::string joined(const std::vector<std::string>& names) {
  std::string out;
  for (const std::string& name : names) out += (out.empty() ? "" : ", ") + name;
  return out;
}

void judge_array(const CaptureState& array, std::vector<Alarm>& alarms) {
  std::vector<std::string> gone, losing;
  for (const auto& camera : array.cameras) {
    if (!camera.connected) gone.push_back(camera.name);
    if (array.phase != CapturePhase::Idle && lost_frames(camera) > 0)
      losing.push_back(concat(camera.name, " (", lost_frames(camera), ")"));
  }
  if (!gone.empty()) alarms.push_back({true, "camera-lost", "No connection to " + joined(gone)});
  if (!losing.empty())
    alarms.push_back({true, "frames-lost", "Frames of this capture lost by " + joined(losing)});
  const std::int64_t unsaved = array.sets - array.sets_stored;
  if (!array.trouble.empty()) {
    alarms.push_back({true, "storing-trouble", array.trouble});
  } else if (unsaved > 20) {
    alarms.push_back({true, "storing-slow", concat(unsaved, " frame sets wait to be written to disk")});
  }
}

void judge_dispatcher(const Status& status, std::vector<Alarm>& alarms) {
  if (status.failed > 0)
    alarms.push_back({false, "jobs-failed", concat(status.failed, " reconstructions have failed")});
  if (status.queued > 0 && status.workers.empty())
    alarms.push_back({false, "no-worker", concat(status.queued, " jobs wait and no worker is connected")});
  for (const auto& worker : status.workers) {
    if (worker.silent_s > 30)
      alarms.push_back({false, "worker-silent", concat("Worker ", worker.name, " is silent")});
  }
}

}  // namespace

std::optional<double> seconds_to_full(const LabState& state) {
  const double bytes_per_s = state.sets_per_s * state.bytes_per_set;
  if (!(bytes_per_s > 0) || state.free_bytes < 0) return std::nullopt;
  return state.free_bytes / bytes_per_s;
}

std::vector<Alarm> alarms_of(const LabState& state) {
  std::vector<Alarm> alarms;
  if (state.array) {
    judge_array(*state.array, alarms);
  } else {
    alarms.push_back({false, "no-array", "The camera array does not answer"});
  }
  if (state.dispatcher) {
    judge_dispatcher(*state.dispatcher, alarms);
  } else {
    alarms.push_back({true, "no-dispatcher", "The dispatcher does not answer: nothing can be stored"});
  }
  constexpr double kShort_s = 600, kLittle_bytes = 2e9;
  const auto left_s = seconds_to_full(state);
  if (left_s && *left_s < kShort_s) {
    alarms.push_back({true, "disk-full", concat("The disk is full in ", static_cast<int>(*left_s), " s")});
  } else if (state.free_bytes >= 0 && state.free_bytes < kLittle_bytes) {
    alarms.push_back(
        {true, "disk-low", concat("Only ", static_cast<int>(state.free_bytes / 1e6), " MB are free")});
  }
  std::ranges::stable_sort(alarms, std::greater<>(), &Alarm::is_severe);
  return alarms;
}

Json json_of(const LabState& state) {
  std::int64_t lost = 0;
  if (state.array) {
    for (const auto& camera : state.array->cameras) lost += lost_frames(camera);
  }
  Json alarms = Json::array();
  for (const Alarm& alarm : alarms_of(state))
    alarms.push_back({{"severe", alarm.is_severe}, {"what", alarm.what}, {"text", alarm.text}});
  const auto left_s = seconds_to_full(state);
  const auto& array = state.array;
  const auto& status = state.dispatcher;
  return {{"topic", "status"},
          {"time_ns", state.time_ns},
          {"array", array ? json_of(*array) : Json(nullptr)},
          {"dispatcher", status ? json_of(*status) : Json(nullptr)},
          {"counters",
           {{"pulses", array ? array->sets : 0},
            {"sets", array ? array->sets_stored : 0},
            {"volumes", state.volumes},
            {"queued", status ? status->queued + status->leased : 0},
            {"failed", status ? status->failed : 0},
            {"lost_frames", lost}}},
          {"sets_per_s", state.sets_per_s},
          {"newest_run", state.newest_run.empty() ? Json(nullptr) : Json(state.newest_run)},
          {"disk",
           {{"free_bytes", state.free_bytes < 0 ? Json(nullptr) : Json(state.free_bytes)},
            {"bytes_per_s", state.sets_per_s * state.bytes_per_set},
            {"seconds_to_full", left_s ? Json(*left_s) : Json(nullptr)}}},
          {"alarms", std::move(alarms)},
          {"report", state.report.empty() ? Json(nullptr) : Json(state.report)}};
}

}  // namespace flamefield
