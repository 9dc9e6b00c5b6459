// Which message it is, and the bytes.
#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>
#include <google/protobuf/stubs/logging.h>

#include <tuple>
#include <type_traits>

#include "proto/codec/wire.h"

namespace flamefield {

namespace {

// A kind of message: its C++ type, and its field in the envelope.
template <class M, class Wire>
struct Row {
  using Type = M;
  v1::Envelope::MessageCase number;
  const Wire& (v1::Envelope::*get)() const;
  Wire* (v1::Envelope::*make)();
};
template <class M, class Wire>
constexpr Row<M, Wire> row(v1::Envelope::MessageCase number, const Wire& (v1::Envelope::*get)() const,
                           Wire* (v1::Envelope::*make)()) {
  return {number, get, make};
}

constexpr auto kRows = std::make_tuple(
    row<PutSet>(v1::Envelope::kPutSet, &v1::Envelope::put_set, &v1::Envelope::mutable_put_set),
    row<SetStored>(v1::Envelope::kSetStored, &v1::Envelope::set_stored, &v1::Envelope::mutable_set_stored),
    row<PutCapture>(v1::Envelope::kPutCapture, &v1::Envelope::put_capture,
                    &v1::Envelope::mutable_put_capture),
    row<PutRig>(v1::Envelope::kPutRig, &v1::Envelope::put_rig, &v1::Envelope::mutable_put_rig),
    row<RigStored>(v1::Envelope::kRigStored, &v1::Envelope::rig_stored, &v1::Envelope::mutable_rig_stored),
    row<LivePlan>(v1::Envelope::kLivePlan, &v1::Envelope::live_plan, &v1::Envelope::mutable_live_plan),
    row<Submit>(v1::Envelope::kSubmit, &v1::Envelope::submit, &v1::Envelope::mutable_submit),
    row<Submitted>(v1::Envelope::kSubmitted, &v1::Envelope::submitted, &v1::Envelope::mutable_submitted),
    row<PutMetrics>(v1::Envelope::kPutMetrics, &v1::Envelope::put_metrics,
                    &v1::Envelope::mutable_put_metrics),
    row<GetStatus>(v1::Envelope::kGetStatus, &v1::Envelope::get_status, &v1::Envelope::mutable_get_status),
    row<Status>(v1::Envelope::kStatus, &v1::Envelope::status, &v1::Envelope::mutable_status),
    row<Ready>(v1::Envelope::kReady, &v1::Envelope::ready, &v1::Envelope::mutable_ready),
    row<Lease>(v1::Envelope::kLease, &v1::Envelope::lease, &v1::Envelope::mutable_lease),
    row<FetchSet>(v1::Envelope::kFetchSet, &v1::Envelope::fetch_set, &v1::Envelope::mutable_fetch_set),
    row<SetData>(v1::Envelope::kSetData, &v1::Envelope::set_data, &v1::Envelope::mutable_set_data),
    row<Heartbeat>(v1::Envelope::kHeartbeat, &v1::Envelope::heartbeat, &v1::Envelope::mutable_heartbeat),
    row<LeaseLost>(v1::Envelope::kLeaseLost, &v1::Envelope::lease_lost, &v1::Envelope::mutable_lease_lost),
    row<Finish>(v1::Envelope::kFinish, &v1::Envelope::finish, &v1::Envelope::mutable_finish),
    row<Committed>(v1::Envelope::kCommitted, &v1::Envelope::committed, &v1::Envelope::mutable_committed),
    row<Fail>(v1::Envelope::kFail, &v1::Envelope::fail, &v1::Envelope::mutable_fail),
    row<Accepted>(v1::Envelope::kAccepted, &v1::Envelope::accepted, &v1::Envelope::mutable_accepted),
    row<Rejected>(v1::Envelope::kRejected, &v1::Envelope::rejected, &v1::Envelope::mutable_rejected),
    row<Event>(v1::Envelope::kEvent, &v1::Envelope::event, &v1::Envelope::mutable_event),
    row<StartCapture>(v1::Envelope::kStartCapture, &v1::Envelope::start_capture,
                      &v1::Envelope::mutable_start_capture),
    row<StopCapture>(v1::Envelope::kStopCapture, &v1::Envelope::stop_capture,
                     &v1::Envelope::mutable_stop_capture),
    row<GetCapture>(v1::Envelope::kGetCapture, &v1::Envelope::get_capture,
                    &v1::Envelope::mutable_get_capture),
    row<GetPreview>(v1::Envelope::kGetPreview, &v1::Envelope::get_preview,
                    &v1::Envelope::mutable_get_preview),
    row<CaptureState>(v1::Envelope::kCaptureState, &v1::Envelope::capture_state,
                      &v1::Envelope::mutable_capture_state),
    row<ControlJobs>(v1::Envelope::kControlJobs, &v1::Envelope::control_jobs,
                     &v1::Envelope::mutable_control_jobs),
    row<JobsControlled>(v1::Envelope::kJobsControlled, &v1::Envelope::jobs_controlled,
                        &v1::Envelope::mutable_jobs_controlled),
    row<GetJobs>(v1::Envelope::kGetJobs, &v1::Envelope::get_jobs, &v1::Envelope::mutable_get_jobs),
    row<Jobs>(v1::Envelope::kJobs, &v1::Envelope::jobs, &v1::Envelope::mutable_jobs),
    row<StandBy>(v1::Envelope::kStandBy, &v1::Envelope::stand_by, &v1::Envelope::mutable_stand_by),
    row<StartCalibration>(v1::Envelope::kStartCalibration, &v1::Envelope::start_calibration,
                          &v1::Envelope::mutable_start_calibration),
    row<TakePose>(v1::Envelope::kTakePose, &v1::Envelope::take_pose, &v1::Envelope::mutable_take_pose),
    row<SolveCalibration>(v1::Envelope::kSolveCalibration, &v1::Envelope::solve_calibration,
                          &v1::Envelope::mutable_solve_calibration),
    row<AcceptCalibration>(v1::Envelope::kAcceptCalibration, &v1::Envelope::accept_calibration,
                           &v1::Envelope::mutable_accept_calibration),
    row<DiscardCalibration>(v1::Envelope::kDiscardCalibration, &v1::Envelope::discard_calibration,
                            &v1::Envelope::mutable_discard_calibration),
    row<GetCalibration>(v1::Envelope::kGetCalibration, &v1::Envelope::get_calibration,
                        &v1::Envelope::mutable_get_calibration),
    row<CalibrationState>(v1::Envelope::kCalibrationState, &v1::Envelope::calibration_state,
                          &v1::Envelope::mutable_calibration_state),
    row<PutCalibration>(v1::Envelope::kPutCalibration, &v1::Envelope::put_calibration,
                        &v1::Envelope::mutable_put_calibration),
    row<CalibrationStored>(v1::Envelope::kCalibrationStored, &v1::Envelope::calibration_stored,
                           &v1::Envelope::mutable_calibration_stored),
    row<PutTags>(v1::Envelope::kPutTags, &v1::Envelope::put_tags, &v1::Envelope::mutable_put_tags),
    row<AcceptRig>(v1::Envelope::kAcceptRig, &v1::Envelope::accept_rig, &v1::Envelope::mutable_accept_rig),
    row<PutSchedule>(v1::Envelope::kPutSchedule, &v1::Envelope::put_schedule,
                     &v1::Envelope::mutable_put_schedule),
    row<DropSchedule>(v1::Envelope::kDropSchedule, &v1::Envelope::drop_schedule,
                      &v1::Envelope::mutable_drop_schedule),
    row<ScheduleRan>(v1::Envelope::kScheduleRan, &v1::Envelope::schedule_ran,
                     &v1::Envelope::mutable_schedule_ran),
    row<Retire>(v1::Envelope::kRetire, &v1::Envelope::retire, &v1::Envelope::mutable_retire));
static_assert(std::tuple_size_v<decltype(kRows)> == std::variant_size_v<Message>);

template <class M>
void write_message(const M& message, v1::Envelope& wire) {
  const auto try_row = [&](const auto& row) {
    if constexpr (std::is_same_v<typename std::decay_t<decltype(row)>::Type, M>)
      write(message, (wire.*row.make)());
  };
  std::apply([&](const auto&... rows) { (try_row(rows), ...); }, kRows);
}

// False when the envelope holds no message, or one of a kind that this version does not know.
bool read_message(const v1::Envelope& wire, Message& message, Check& check) {
  const auto try_row = [&](const auto& row) {
    if (wire.message_case() != row.number) return false;
    typename std::decay_t<decltype(row)>::Type value;
    read((wire.*row.get)(), value, check);
    message = std::move(value);
    return true;
  };
  return std::apply([&](const auto&... rows) { return (try_row(rows) || ...); }, kRows);
}

}  // namespace

std::string encode(const Message& message, std::uint64_t request) {
  v1::Envelope wire;
  wire.set_request(request);
  std::visit([&](const auto& m) { write_message(m, wire); }, message);
  // Deterministic: maps in the order of their keys, so that equal messages are equal bytes.
  std::string bytes;
  google::protobuf::io::StringOutputStream stream(&bytes);
  google::protobuf::io::CodedOutputStream coded(&stream);
  coded.SetSerializationDeterministic(true);
  wire.SerializeToCodedStream(&coded);
  coded.Trim();
  return bytes;
}
Result<Envelope> decode(std::span<const std::byte> header) {
  const auto refuse = [](std::string_view why) {
    return invalid_input("message on the bus", why, "drop it; is the sender of another version?");
  };
  if (header.size() > kMaxHeaderBytes)
    return refuse(concat("its header is larger than ", kMaxHeaderBytes >> 20, " MiB"));
  // Protobuf would print what is wrong with bytes from outside, as often as someone sends them.
  const google::protobuf::LogSilencer silence;
  v1::Envelope wire;
  if (!wire.ParseFromArray(header.data(), static_cast<int>(header.size())))
    return refuse("its header is not an Envelope");
  Check check;
  Envelope envelope;
  envelope.request = wire.request();
  if (!read_message(wire, envelope.message, check)) return refuse("its kind is unknown");
  if (!check.problem().empty()) return refuse(check.problem());
  return envelope;
}

}  // namespace flamefield
