// Frames and sets. Pixels stay outside.
#include "proto/codec/wire.h"

namespace flamefield {

void write(const SetId& id, v1::SetId* wire) {
  wire->set_capture(id.capture);
  wire->set_index(id.index);
}

void read(const v1::SetId& wire, SetId& id, Check& check) {
  id = {wire.capture(), wire.index()};
  check.name(id.capture, "capture");
  check.count(id.index, "set index");
}

void write(const Frame& frame, v1::Frame* wire) {
  wire->set_camera(frame.camera);
  wire->set_pulse(frame.pulse);
  wire->set_device_time_ns(frame.device_time_ns);
  wire->set_arrival_time_ns(frame.arrival_time_ns);
  wire->set_exposure_us(frame.exposure_us);
  wire->set_width_px(frame.width_px);
  wire->set_height_px(frame.height_px);
  wire->set_pixel_format(std::string(name_of(frame.format)));
  wire->set_bytes(frame.bytes ? static_cast<std::int64_t>(frame.bytes->size()) : 0);
}

void read(const v1::Frame& wire, Frame& frame, Check& check) {
  frame.camera = wire.camera();
  frame.pulse = wire.pulse();
  frame.device_time_ns = wire.device_time_ns();
  frame.arrival_time_ns = wire.arrival_time_ns();
  frame.exposure_us = wire.exposure_us();
  frame.width_px = wire.width_px();
  frame.height_px = wire.height_px();
  check.name(frame.camera, "camera of a frame");
  check.count(frame.exposure_us, "exposure_us");
  read_enum(wire.pixel_format(), pixel_format_from_name(wire.pixel_format()), frame.format, "pixel format",
            check);
  const bool fits =
      frame.width_px > 0 && frame.height_px > 0 && frame.width_px <= 65536 && frame.height_px <= 65536;
  check.require(fits, "frame size", "each side must be 1 to 65536 px");
  if (!fits) return;
  const std::size_t wanted = bytes_of_image(frame.format, frame.width_px, frame.height_px);
  check.require(wanted <= kMaxFrameBytes, "frame size", "more than 256 MiB");
  check.require(wire.bytes() == static_cast<std::int64_t>(wanted), "frame bytes",
                "do not match size and format");
}

void write(const FrameLoss& loss, v1::FrameLoss* wire) {
  wire->set_camera(loss.camera);
  wire->set_cause(std::string(name_of(loss.cause)));
}

void read(const v1::FrameLoss& wire, FrameLoss& loss, Check& check) {
  loss.camera = wire.camera();
  check.name(loss.camera, "camera of a loss");
  read_enum(wire.cause(), loss_cause_from_name(wire.cause()), loss.cause, "loss cause", check);
}

void write(const FrameSet& set, v1::FrameSet* wire) {
  wire->set_capture(set.capture);
  wire->set_kind(std::string(name_of(set.kind)));
  wire->set_pulse(set.pulse);
  wire->set_index(set.index);
  wire->set_pulse_time_ns(set.pulse_time_ns);
  wire->set_complete_time_ns(set.complete_time_ns);
  write_all(set.frames, wire->mutable_frames());
  write_all(set.losses, wire->mutable_losses());
}

void read(const v1::FrameSet& wire, FrameSet& set, Check& check) {
  check.require(wire.frames_size() + wire.losses_size() <= kMaxCameras, "frame set", "more than 256 cameras");
  if (!check.problem().empty()) return;
  set.capture = wire.capture();
  set.pulse = wire.pulse();
  set.index = wire.index();
  set.pulse_time_ns = wire.pulse_time_ns();
  set.complete_time_ns = wire.complete_time_ns();
  check.name(set.capture, "capture");
  check.count(set.index, "set index");
  read_enum(wire.kind(), capture_kind_from_name(wire.kind()), set.kind, "capture kind", check);
  read_all(wire.frames(), set.frames, check);
  read_all(wire.losses(), set.losses, check);
}

}  // namespace flamefield
