// Shared by the files of this folder only. Two overload sets, one per direction: write(value, wire) and
// read(wire, value, check). They mirror the .proto files message by message, so that a new field is two
// lines.
#pragma once

#include <cmath>
#include <initializer_list>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "flamefield/v1/bus.pb.h"
#include "proto/codec.h"

namespace flamefield {

// Remembers the first thing that was wrong.
class Check {
 public:
  void require(bool holds, std::string_view field, std::string_view why) {
    if (!holds && problem_.empty()) problem_ = concat(field, ": ", why);
  }
  void finite(double value, std::string_view field) {
    require(std::isfinite(value), field, "is not a finite number");
  }
  void count(std::int64_t value, std::string_view field) { require(value >= 0, field, "is negative"); }
  void name(const std::string& text, std::string_view field) {
    require(text.size() <= 100 && is_file_safe(text), field,
            "is not a name (letters, digits, '.', '_', '-', at most 100)");
  }
  void optional_name(const std::string& text, std::string_view field) {
    if (!text.empty()) name(text, field);
  }
  void result(const Result<>& result, std::string_view field) {
    if (!result) require(false, field, result.error().message);
  }
  const std::string& problem() const { return problem_; }

 private:
  std::string problem_;
};

template <class Enum>
void read_enum(const std::string& text, std::optional<Enum> found, Enum& out, std::string_view field,
               Check& check) {
  check.require(found.has_value(), field, concat("unknown value '", text.substr(0, 40), "'"));
  if (found) out = *found;
}

template <class Enum>
std::optional<Enum> one_of(const std::string& text, std::initializer_list<Enum> values) {
  for (Enum value : values) {
    if (name_of(value) == text) return value;
  }
  return std::nullopt;
}

// sets.cc
void write(const SetId& id, v1::SetId* wire);
void read(const v1::SetId& wire, SetId& id, Check& check);
void write(const Frame& frame, v1::Frame* wire);
void read(const v1::Frame& wire, Frame& frame, Check& check);
void write(const FrameLoss& loss, v1::FrameLoss* wire);
void read(const v1::FrameLoss& wire, FrameLoss& loss, Check& check);
void write(const FrameSet& set, v1::FrameSet* wire);
void read(const v1::FrameSet& wire, FrameSet& set, Check& check);

// rig.cc
void write(const Camera& camera, v1::Camera* wire);
void read(const v1::Camera& wire, Camera& camera, Check& check);
void write(const CameraQuality& quality, v1::CameraQuality* wire);
void read(const v1::CameraQuality& wire, CameraQuality& quality, Check& check);
void write(const Rig& rig, v1::Rig* wire);
void read(const v1::Rig& wire, Rig& rig, Check& check);

// jobs.cc
void write(const Recipe& recipe, v1::Recipe* wire);
void read(const v1::Recipe& wire, Recipe& recipe, Check& check);
void write(const Grid& grid, v1::Grid* wire);
void read(const v1::Grid& wire, Grid& grid, Check& check);
void write(const Processing& processing, v1::Processing* wire);
void read(const v1::Processing& wire, Processing& processing, Check& check);
void write(const Job& job, v1::Job* wire);
void read(const v1::Job& wire, Job& job, Check& check);
void read_priority(const std::string& text, Priority& priority, Check& check);

// runs.cc
void write(const Progress& progress, v1::Progress* wire);
void read(const v1::Progress& wire, Progress& progress, Check& check);
void write(const HistoryPoint& point, v1::HistoryPoint* wire);
void read(const v1::HistoryPoint& wire, HistoryPoint& point, Check& check);
void write(const Run& run, v1::Run* wire);
void read(const v1::Run& wire, Run& run, Check& check);

// storing.cc
void write(const PutSet& m, v1::PutSet* wire);
void read(const v1::PutSet& wire, PutSet& m, Check& check);
void write(const SetStored& m, v1::SetStored* wire);
void read(const v1::SetStored& wire, SetStored& m, Check& check);
void write(const PutCapture& m, v1::PutCapture* wire);
void read(const v1::PutCapture& wire, PutCapture& m, Check& check);
void write(const PutRig& m, v1::PutRig* wire);
void read(const v1::PutRig& wire, PutRig& m, Check& check);
void write(const RigStored& m, v1::RigStored* wire);
void read(const v1::RigStored& wire, RigStored& m, Check&);
void write(const LivePlan& m, v1::LivePlan* wire);
void read(const v1::LivePlan& wire, LivePlan& m, Check& check);
void write(const Submit& m, v1::Submit* wire);
void read(const v1::Submit& wire, Submit& m, Check& check);
void write(const Submitted& m, v1::Submitted* wire);
void read(const v1::Submitted& wire, Submitted& m, Check&);
void write(const PutMetrics& m, v1::PutMetrics* wire);
void read(const v1::PutMetrics& wire, PutMetrics& m, Check& check);
void write(const GetStatus&, v1::GetStatus* wire);
void read(const v1::GetStatus&, GetStatus&, Check&);
void write(const Status& m, v1::Status* wire);
void read(const v1::Status& wire, Status& m, Check& check);

// working.cc
void write(const Ready& m, v1::Ready* wire);
void read(const v1::Ready& wire, Ready& m, Check& check);
void write(const Lease& m, v1::Lease* wire);
void read(const v1::Lease& wire, Lease& m, Check& check);
void write(const FetchSet& m, v1::FetchSet* wire);
void read(const v1::FetchSet& wire, FetchSet& m, Check& check);
void write(const SetData& m, v1::SetData* wire);
void read(const v1::SetData& wire, SetData& m, Check& check);
void write(const Heartbeat& m, v1::Heartbeat* wire);
void read(const v1::Heartbeat& wire, Heartbeat& m, Check& check);
void write(const LeaseLost& m, v1::LeaseLost* wire);
void read(const v1::LeaseLost& wire, LeaseLost& m, Check&);
void write(const Finish& m, v1::Finish* wire);
void read(const v1::Finish& wire, Finish& m, Check& check);
void write(const Committed& m, v1::Committed* wire);
void read(const v1::Committed& wire, Committed& m, Check&);
void write(const Fail& m, v1::Fail* wire);
void read(const v1::Fail& wire, Fail& m, Check& check);

// controlling.cc
void write(const ControlJobs& m, v1::ControlJobs* wire);
void read(const v1::ControlJobs& wire, ControlJobs& m, Check& check);
void write(const JobsControlled& m, v1::JobsControlled* wire);
void read(const v1::JobsControlled& wire, JobsControlled& m, Check&);
void write(const GetJobs& m, v1::GetJobs* wire);
void read(const v1::GetJobs& wire, GetJobs& m, Check& check);
void write(const Jobs& m, v1::Jobs* wire);
void read(const v1::Jobs& wire, Jobs& m, Check& check);

// capturing.cc
void write(const StartCapture& m, v1::StartCapture* wire);
void read(const v1::StartCapture& wire, StartCapture& m, Check& check);
void write(const CameraAccount& account, v1::CameraAccount* wire);
void read(const v1::CameraAccount& wire, CameraAccount& account, Check& check);
void write(const StandBy&, v1::StandBy* wire);
void read(const v1::StandBy&, StandBy&, Check&);
void write(const StopCapture&, v1::StopCapture* wire);
void read(const v1::StopCapture&, StopCapture&, Check&);
void write(const GetCapture&, v1::GetCapture* wire);
void read(const v1::GetCapture&, GetCapture&, Check&);
void write(const GetPreview& m, v1::GetPreview* wire);
void read(const v1::GetPreview& wire, GetPreview& m, Check& check);
void write(const CaptureState& m, v1::CaptureState* wire);
void read(const v1::CaptureState& wire, CaptureState& m, Check& check);

// calibrating.cc
void write(const BoardSpec& m, v1::BoardSpec* wire);
void read(const v1::BoardSpec& wire, BoardSpec& m, Check& check);
void write(const StartCalibration& m, v1::StartCalibration* wire);
void read(const v1::StartCalibration& wire, StartCalibration& m, Check& check);
void write(const TakePose& m, v1::TakePose* wire);
void read(const v1::TakePose& wire, TakePose& m, Check& check);
void write(const SolveCalibration& m, v1::SolveCalibration* wire);
void read(const v1::SolveCalibration& wire, SolveCalibration& m, Check& check);
void write(const AcceptCalibration& m, v1::AcceptCalibration* wire);
void read(const v1::AcceptCalibration& wire, AcceptCalibration& m, Check& check);
void write(const DiscardCalibration& m, v1::DiscardCalibration* wire);
void read(const v1::DiscardCalibration& wire, DiscardCalibration& m, Check& check);
void write(const GetCalibration& m, v1::GetCalibration* wire);
void read(const v1::GetCalibration& wire, GetCalibration& m, Check& check);
void write(const CalibrationState& m, v1::CalibrationState* wire);
void read(const v1::CalibrationState& wire, CalibrationState& m, Check& check);
void write(const Calibration& m, v1::Calibration* wire);
void read(const v1::Calibration& wire, Calibration& m, Check& check);
void write(const PutCalibration& m, v1::PutCalibration* wire);
void read(const v1::PutCalibration& wire, PutCalibration& m, Check& check);
void write(const CalibrationStored& m, v1::CalibrationStored* wire);
void read(const v1::CalibrationStored& wire, CalibrationStored& m, Check& check);

// upkeep.cc
void write(const PutTags& m, v1::PutTags* wire);
void read(const v1::PutTags& wire, PutTags& m, Check& check);
void write(const AcceptRig& m, v1::AcceptRig* wire);
void read(const v1::AcceptRig& wire, AcceptRig& m, Check& check);
void write(const Schedule& m, v1::Schedule* wire);
void read(const v1::Schedule& wire, Schedule& m, Check& check);
void write(const PutSchedule& m, v1::PutSchedule* wire);
void read(const v1::PutSchedule& wire, PutSchedule& m, Check& check);
void write(const DropSchedule& m, v1::DropSchedule* wire);
void read(const v1::DropSchedule& wire, DropSchedule& m, Check& check);
void write(const ScheduleRan& m, v1::ScheduleRan* wire);
void read(const v1::ScheduleRan& wire, ScheduleRan& m, Check& check);
void write(const Retire& m, v1::Retire* wire);
void read(const v1::Retire& wire, Retire& m, Check& check);

// replies.cc
void write(const Error& error, v1::Error* wire);
void read(const v1::Error& wire, Error& error, Check& check);
void write(const Accepted&, v1::Accepted* wire);
void read(const v1::Accepted&, Accepted&, Check&);
void write(const Rejected& m, v1::Rejected* wire);
void read(const v1::Rejected& wire, Rejected& m, Check& check);
void write(const Event& m, v1::Event* wire);
void read(const v1::Event& wire, Event& m, Check&);

// Repeated fields and maps.
template <class T, class Wire>
void write_all(const std::vector<T>& values, Wire* wire) {
  for (const T& value : values) {
    if constexpr (requires { write(value, wire->Add()); })
      write(value, wire->Add());
    else
      *wire->Add() = value;
  }
}

template <class T, class Wire>
void read_all(const Wire& wire, std::vector<T>& values, Check& check) {
  values.resize(static_cast<std::size_t>(wire.size()));
  for (int i = 0; i < wire.size(); ++i) read(wire[i], values[static_cast<std::size_t>(i)], check);
}

template <class Wire>
void read_numbers(const Wire& wire, std::map<std::string, double>& values, std::string_view field,
                  Check& check) {
  for (const auto& [key, value] : wire) {
    check.finite(value, field);
    values[key] = value;
  }
}

}  // namespace flamefield
