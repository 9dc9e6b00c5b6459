// How a camera is set: every value is read back.
#include <cmath>
#include <string>

#include "acquire/aravis_handles.h"

namespace flamefield {

bool AravisDevice::has(const char* feature) const {
  return handles_->has(feature);
}

// Each sets one feature and reads it back.
Result<> AravisDevice::set(const char* feature, std::int64_t value) {
  ArvError error;
  arv_camera_set_integer(handles_->camera, feature, value, error.out());
  const gint64 got = error.happened() ? 0 : arv_camera_get_integer(handles_->camera, feature, error.out());
  if (error.happened()) return handles_->failed(concat(feature, "=", value), error);
  return got == value ? Result<>() : handles_->differs<std::int64_t>(feature, value, got);
}

Result<> AravisDevice::set(const char* feature, std::string_view value) {
  ArvError error;
  arv_camera_set_string(handles_->camera, feature, std::string(value).c_str(), error.out());
  const char* got = error.happened() ? "" : arv_camera_get_string(handles_->camera, feature, error.out());
  if (error.happened()) return handles_->failed(concat(feature, "=", value), error);
  return value == got ? Result<>() : handles_->differs<std::string_view>(feature, value, got);
}

Result<> AravisDevice::set_real(const char* feature, double value) {
  ArvError error;
  arv_camera_set_float(handles_->camera, feature, value, error.out());
  const double got = error.happened() ? 0 : arv_camera_get_float(handles_->camera, feature, error.out());
  if (error.happened()) return handles_->failed(concat(feature, "=", value), error);
  return std::abs(got - value) <= 1 ? Result<>() : handles_->differs(feature, value, got);
}

Result<> AravisDevice::apply(const CameraSettings& settings) {
  if (auto ok = validate(settings); !ok) return ok;
  settings_ = settings;
  arv_camera_stop_acquisition(handles_->camera, nullptr);  // a crashed client may have left it running
  Result<> ok = configure_image(settings);
  if (ok) ok = configure_trigger(settings);
  if (ok) ok = configure_transport(settings);
  if (ok) ok = configure_chunks();
  if (!ok) return ok;
  ArvError error;
  payload_bytes_ = arv_camera_get_payload(handles_->camera, error.out());
  if (error.happened() || payload_bytes_ == 0) return handles_->failed("reading PayloadSize", error);
  return {};
}

Result<> AravisDevice::configure_image(const CameraSettings& settings) {
  Result<> ok;
  // Binning first: it changes what fits on the sensor.
  const bool is_binned = settings.binning_x > 1 || settings.binning_y > 1;
  if (is_binned || has("BinningHorizontal")) {
    ok = set("BinningHorizontal", settings.binning_x);
    if (ok) ok = set("BinningVertical", settings.binning_y);
  }
  if (ok) ok = set("PixelFormat", name_of(settings.pixel_format));
  if (!ok) return ok;
  ArvError error;
  SensorRegion wanted;
  if (settings.region) {
    wanted = *settings.region;
  } else {
    arv_camera_set_region(handles_->camera, 0, 0, -1, -1, nullptr);
    gint unused = 0;
    arv_camera_get_width_bounds(handles_->camera, &unused, &wanted.width_px, error.out());
    if (!error.happened()) {
      arv_camera_get_height_bounds(handles_->camera, &unused, &wanted.height_px, error.out());
    }
    if (!error.happened() && is_binned) {
      arv_camera_get_region(handles_->camera, nullptr, nullptr, &wanted.width_px, &wanted.height_px,
                            error.out());
    }
  }
  SensorRegion got;
  if (!error.happened()) {
    arv_camera_set_region(handles_->camera, wanted.offset_x_px, wanted.offset_y_px, wanted.width_px,
                          wanted.height_px, error.out());
  }
  if (!error.happened()) {
    arv_camera_get_region(handles_->camera, &got.offset_x_px, &got.offset_y_px, &got.width_px, &got.height_px,
                          error.out());
  }
  if (error.happened()) return handles_->failed("region of interest", error);
  const auto text = [](const SensorRegion& r) {
    return concat(r.width_px, "x", r.height_px, "+", r.offset_x_px, "+", r.offset_y_px);
  };
  if (text(wanted) != text(got)) return handles_->differs("region", text(wanted), text(got));
  if (settings.gain_raw) ok = set("GainRaw", *settings.gain_raw);
  if (ok && settings.black_level_raw) ok = set("BlackLevelRaw", *settings.black_level_raw);
  if (ok && (settings.test_image || has("TestImageSelector"))) {
    ok = set("TestImageSelector", settings.test_image ? "Testimage1" : "Off");
  }
  return ok;
}

Result<> AravisDevice::configure_trigger(const CameraSettings& settings) {
  ArvError error;
  arv_camera_set_exposure_time(handles_->camera, settings.exposure_us, error.out());
  double got_us = 0;
  if (!error.happened()) got_us = arv_camera_get_exposure_time(handles_->camera, error.out());
  if (!error.happened())
    arv_camera_set_acquisition_mode(handles_->camera, ARV_ACQUISITION_MODE_CONTINUOUS, error.out());
  if (!error.happened())
    arv_camera_set_trigger(handles_->camera, settings.trigger_source.c_str(), error.out());
  if (error.happened()) return handles_->failed("exposure time, AcquisitionMode or TriggerSource", error);
  if (!(std::abs(got_us - settings.exposure_us) <= 1)) {
    return handles_->differs<double>("exposure_us", settings.exposure_us, got_us);
  }
  Result<> ok = set("TriggerSource", settings.trigger_source);
  const bool is_line = settings.trigger_source.starts_with("Line");
  if (ok && is_line) ok = set("TriggerActivation", settings.trigger_activation);
  if (ok && settings.action) {
    if (has("ActionSelector")) ok = set("ActionSelector", std::int64_t{1});
    // The device key may be write-only (SFNC), so that others cannot learn it.
    arv_camera_set_integer(handles_->camera, "ActionDeviceKey", settings.action->device_key, error.out());
    if (error.happened()) return handles_->failed("ActionDeviceKey", error);
    if (ok) ok = set("ActionGroupKey", std::int64_t{settings.action->group_key});
    if (ok) ok = set("ActionGroupMask", std::int64_t{settings.action->group_mask});
  }
  if (ok && (settings.trigger_delay_us > 0 || has("TriggerDelayAbs"))) {
    ok = set_real("TriggerDelayAbs", settings.trigger_delay_us);
  }
  return ok;
}

Result<> AravisDevice::configure_transport(const CameraSettings& settings) {
  ArvCamera* camera = handles_->camera;
  ArvError error;
  arv_camera_gv_set_packet_size_adjustment(camera, ARV_GV_PACKET_SIZE_ADJUSTMENT_NEVER);
  arv_camera_gv_set_packet_size(camera, settings.packet_size_bytes, error.out());
  guint packet_size = 0;
  if (!error.happened()) packet_size = arv_camera_gv_get_packet_size(camera, error.out());
  if (error.happened()) return handles_->failed("packet size", error);
  if (static_cast<int>(packet_size) != settings.packet_size_bytes) {
    return handles_->differs<std::int64_t>("packet_size_bytes", settings.packet_size_bytes, packet_size);
  }
  // Delays are in ticks of the camera's clock.
  const double packet_delay_ticks =
      static_cast<double>(settings.packet_delay_ns) * 1e-9 * handles_->tick_frequency_hz();
  Result<> ok;
  if (settings.packet_delay_ns > 0 || has("GevSCPD")) ok = set("GevSCPD", std::llround(packet_delay_ticks));
  if (ok) ok = set_frame_delay(handles_->address.frame_delay_ns);
  // Clocks that keep each other's time make the fitted ones better.
  for (const char* feature : {"GevIEEE1588", "PtpEnable"}) {
    if (ok && has(feature)) arv_camera_set_boolean(camera, feature, TRUE, nullptr);
  }
  return ok;
}

Result<> AravisDevice::set_frame_delay(std::int64_t delay_ns) {
  handles_->address.frame_delay_ns = delay_ns;
  if (delay_ns == 0 && !has("GevSCFTD")) return {};
  const double ticks = static_cast<double>(delay_ns) * 1e-9 * handles_->tick_frequency_hz();
  return set("GevSCFTD", std::llround(ticks));
}

Result<FrameShape> AravisDevice::shape() {
  ArvError error;
  FrameShape out;
  arv_camera_get_region(handles_->camera, nullptr, nullptr, &out.width_px, &out.height_px, error.out());
  if (error.happened()) return handles_->failed("region of interest", error);
  out.payload_bytes = static_cast<std::int64_t>(payload_bytes_);
  return out;
}

std::optional<SharedClock> AravisDevice::shared_clock() {
  if (!is_clock_anchored_) return std::nullopt;
  for (const char* feature : {"GevIEEE1588Status", "PtpStatus"}) {
    if (!has(feature)) continue;
    const char* status = arv_camera_get_string(handles_->camera, feature, nullptr);
    const std::string_view text = status ? status : "";
    if (text != "Slave" && text != "Master") return std::nullopt;
    return SharedClock{-*clock_offset_ns_, clock_error_ns_, handles_->tick_frequency_hz()};
  }
  return std::nullopt;
}

Result<> AravisDevice::configure_chunks() {
  has_counter_ = false;
  if (!arv_camera_are_chunks_available(handles_->camera, nullptr)) return {};
  ArvError error;
  arv_camera_set_chunks(handles_->camera, "Framecounter,Triggerinputcounter,Timestamp", error.out());
  if (error.happened()) return handles_->failed("chunks", error);
  g_clear_object(&handles_->chunks);
  {
    const std::lock_guard lock(genicam_parser);
    handles_->chunks = arv_camera_create_chunk_parser(handles_->camera);
  }
  // A count means something only when it can be set to zero and asked for at arming.
  has_counter_ = handles_->chunks && handles_->has("CounterReset") && handles_->has("CounterValue");
  arv_camera_set_chunk_state(handles_->camera, "ExposureTime", TRUE, error.out());  // a camera may lack it
  has_exposure_ = handles_->chunks && !error.happened();
  return {};
}

}  // namespace flamefield
