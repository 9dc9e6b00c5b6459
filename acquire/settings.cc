#include "acquire/settings.h"

namespace flamefield {

namespace {

Result<> check_range(const char* name, std::int64_t value, std::int64_t min, std::int64_t max) {
  if (value >= min && value <= max) return {};
  return invalid_input(concat(name, "=", value), concat("must be ", min, " to ", max),
                       "change the camera settings");
}

}  // namespace

Result<> validate(const CameraSettings& settings) {
  Result<> ok = check_range("exposure_us", settings.exposure_us, 4, 1'000'000);
  if (ok) ok = check_range("trigger_delay_us", settings.trigger_delay_us, 0, 1'000'000);
  if (ok) ok = check_range("binning_x", settings.binning_x, 1, 4);
  if (ok) ok = check_range("binning_y", settings.binning_y, 1, 4);
  if (ok && settings.black_level_raw)
    ok = check_range("black_level_raw", *settings.black_level_raw, 0, 100'000);
  if (ok) ok = check_range("packet_size_bytes", settings.packet_size_bytes, 220, 16404);
  if (ok) ok = check_range("packet_delay_ns", settings.packet_delay_ns, 0, 1'000'000'000);
  if (ok) ok = check_range("buffers", settings.buffers, 2, 1000);
  if (ok) ok = check_range("socket_buffer_bytes", settings.socket_buffer_bytes, 65536, 1 << 30);
  if (ok && settings.gain_raw) ok = check_range("gain_raw", *settings.gain_raw, 0, 100'000);
  if (ok && settings.region) {
    ok = check_range("region.offset_x_px", settings.region->offset_x_px, 0, 65535);
    if (ok) ok = check_range("region.offset_y_px", settings.region->offset_y_px, 0, 65535);
    if (ok) ok = check_range("region.width_px", settings.region->width_px, 1, 65535);
    if (ok) ok = check_range("region.height_px", settings.region->height_px, 1, 65535);
  }
  if (ok && settings.action && settings.action->group_mask == 0) {
    return invalid_input("action group_mask=0", "no camera of that mask is ever fired", "use e.g. 1");
  }
  if (ok && settings.trigger_source.empty()) {
    return invalid_input("trigger_source is empty", "cameras take pictures only when triggered",
                         "use Line1, Software or Action1");
  }
  return ok;
}

}  // namespace flamefield
