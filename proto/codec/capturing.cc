// Messages between the array and who captures.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const StartCapture& m, v1::StartCapture* wire) {
  wire->set_kind(std::string(name_of(m.kind)));
  wire->set_pulses(m.pulses);
  wire->set_id(m.id);
  wire->set_pre_pulses(m.pre_pulses);
  wire->set_show_only(!m.store);
}
void read(const v1::StartCapture& wire, StartCapture& m, Check& check) {
  m.pulses = wire.pulses();
  m.id = wire.id();
  m.pre_pulses = wire.pre_pulses();
  m.store = !wire.show_only();
  check.count(m.pulses, "pulses");
  check.count(m.pre_pulses, "pre_pulses");
  check.optional_name(m.id, "capture");
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), m.kind, "capture kind", check);
}

void write(const CameraAccount& account, v1::CameraAccount* wire) {
  wire->set_camera(account.camera);
  wire->set_frames_in(account.frames_in);
  wire->set_delivered(account.delivered);
  for (const auto& [cause, count] : account.losses) (*wire->mutable_losses())[cause] = count;
  for (const auto& [name, count] : account.counters) (*wire->mutable_counters())[name] = count;
}
void read(const v1::CameraAccount& wire, CameraAccount& account, Check& check) {
  account = {wire.camera(), wire.frames_in(), wire.delivered(), {}, {}};
  check.name(account.camera, "camera");
  for (const auto& [cause, count] : wire.losses()) {
    check.require(loss_cause_from_name(cause).has_value(), "loss cause", "unknown");
    account.losses[cause] = count;
  }
  for (const auto& [name, count] : wire.counters()) {
    check.name(name, "counter");
    account.counters[name] = count;
  }
}

void write(const StandBy&, v1::StandBy*) {}
void read(const v1::StandBy&, StandBy&, Check&) {}

void write(const StopCapture&, v1::StopCapture*) {}
void read(const v1::StopCapture&, StopCapture&, Check&) {}

void write(const GetCapture&, v1::GetCapture*) {}
void read(const v1::GetCapture&, GetCapture&, Check&) {}

void write(const GetPreview& m, v1::GetPreview* wire) {
  wire->set_camera(m.camera);
}
void read(const v1::GetPreview& wire, GetPreview& m, Check& check) {
  m.camera = wire.camera();
  if (!m.camera.empty()) check.name(m.camera, "camera");
}

void write(const CaptureState& m, v1::CaptureState* wire) {
  wire->set_phase(std::string(name_of(m.phase)));
  wire->set_id(m.id);
  wire->set_kind(std::string(name_of(m.kind)));
  wire->set_pulses_wanted(m.pulses_wanted);
  wire->set_sets(m.sets);
  wire->set_sets_stored(m.sets_stored);
  for (const CaptureState::CameraState& camera : m.cameras) {
    auto* out = wire->add_cameras();
    out->set_name(camera.name);
    out->set_address(camera.address);
    out->set_connected(camera.connected);
    out->set_frames(camera.frames);
    for (const auto& [cause, count] : camera.losses) (*out->mutable_losses())[cause] = count;
    out->set_newest_age_s(camera.newest_age_s);
    for (const auto& [name, count] : camera.counters) (*out->mutable_counters())[name] = count;
  }
  wire->set_pre_pulses(m.pre_pulses);
  wire->set_sets_held(m.sets_held);
  wire->set_previews_skipped(m.previews_skipped);
  wire->set_trouble(m.trouble);
}
void read(const v1::CaptureState& wire, CaptureState& m, Check& check) {
  m = {};
  m.id = wire.id();
  m.pulses_wanted = wire.pulses_wanted();
  m.sets = wire.sets();
  m.sets_stored = wire.sets_stored();
  m.pre_pulses = wire.pre_pulses();
  m.sets_held = wire.sets_held();
  m.previews_skipped = wire.previews_skipped();
  m.trouble = wire.trouble();
  read_enum(wire.phase(),
            one_of(wire.phase(),
                   {CapturePhase::Idle, CapturePhase::Standby, CapturePhase::Armed, CapturePhase::Draining}),
            m.phase, "capture phase", check);
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), m.kind, "capture kind", check);
  check.optional_name(m.id, "capture");
  check.require(wire.cameras_size() <= kMaxCameras, "capture", "more than 256 cameras");
  for (const auto& in : wire.cameras()) {
    CaptureState::CameraState camera{in.name(),   in.address(), in.connected(),
                                     in.frames(), {},           in.newest_age_s()};
    check.name(camera.name, "camera");
    check.finite(camera.newest_age_s, "age of the newest frame");
    for (const auto& [cause, count] : in.losses()) camera.losses[cause] = count;
    for (const auto& [name, count] : in.counters()) camera.counters[name] = count;
    m.cameras.push_back(std::move(camera));
  }
}

}  // namespace flamefield
