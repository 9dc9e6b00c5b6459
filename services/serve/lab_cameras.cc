#include "services/serve/lab_cameras.h"

#include <cmath>

namespace flamefield {

std::vector<CameraAddress> cameras_of(const LabConfig& lab) {
  std::vector<CameraAddress> out;
  for (const LabCamera& camera : lab.cameras) out.push_back({camera.name, camera.address, camera.serial});
  return out;
}

BandwidthNeeds bandwidth_needs_of(const LabConfig& lab) {
  BandwidthNeeds needs;
  needs.cameras = lab.cameras.empty() ? static_cast<std::size_t>(lab.simulated_cameras) : lab.cameras.size();
  needs.rate_hz = lab.trigger_rate_hz;
  needs.width_px /= lab.binning_x;
  needs.height_px /= lab.binning_y;
  needs.format = lab.pixel_format;
  needs.packet_size_bytes = lab.packet_size_bytes;
  needs.exposure_us = lab.exposure_us;
  needs.uplink_bits_per_s = 1e6 * lab.link_mbit_per_s;
  needs.switch_buffer_bytes = std::int64_t{lab.switch_buffer_kib} << 10;
  return needs;
}

Result<std::vector<CameraAddress>> planned_cameras_of(const LabConfig& lab) {
  std::vector<CameraAddress> cameras = cameras_of(lab);
  if (cameras.empty()) return cameras;
  const auto plan = plan_bandwidth(bandwidth_needs_of(lab));
  if (!plan) return tl::unexpected(plan.error());
  for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i].frame_delay_ns = plan->frame_delay_ns[i];
  return cameras;
}

CameraSettings settings_of(const LabConfig& lab) {
  constexpr double kDecibelPerRawStep = 0.0359;  // of the acA645's GainRaw
  CameraSettings settings;
  settings.trigger_source = lab.trigger_line;
  settings.exposure_us = lab.exposure_us;
  settings.gain_raw = static_cast<int>(std::lround(lab.gain_db / kDecibelPerRawStep));
  settings.pixel_format = lab.pixel_format;
  settings.trigger_delay_us = lab.trigger_delay_us;
  if (lab.black_level_raw > 0) settings.black_level_raw = lab.black_level_raw;
  settings.binning_x = lab.binning_x;
  settings.binning_y = lab.binning_y;
  settings.packet_size_bytes = lab.packet_size_bytes;
  return settings;
}

}  // namespace flamefield
