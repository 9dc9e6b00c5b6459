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
  // Of the camera that most laboratories of this kind have; once cameras are open, they say it themselves.
  needs.width_px = lab.width_px > 0 ? lab.width_px : needs.width_px / lab.binning_x;
  needs.height_px = lab.height_px > 0 ? lab.height_px : needs.height_px / lab.binning_y;
  needs.format = lab.pixel_format;
  needs.packet_size_bytes = lab.packet_size_bytes;
  needs.exposure_us = lab.exposure_us;
  needs.uplink_bits_per_s = 1e6 * lab.link_mbit_per_s;
  needs.switch_buffer_bytes = std::int64_t{lab.switch_buffer_kib} << 10;
  return needs;
}

AcquisitionOptions acquisition_of(const LabConfig& lab) {
  AcquisitionOptions options;
  options.cameras = cameras_of(lab);
  options.settings = settings_of(lab);
  if (!options.cameras.empty()) options.network = bandwidth_needs_of(lab);
  if (lab.trigger_source == "action") options.action_rate_hz = lab.trigger_rate_hz;
  options.history = {lab.history_pulses, std::int64_t{lab.history_mib} << 20};
  options.journal = lab.data_directory / "capture.journal";
  return options;
}

CameraSettings settings_of(const LabConfig& lab) {
  constexpr double kDecibelPerRawStep = 0.0359;  // of the acA645's GainRaw
  CameraSettings settings;
  settings.trigger_source = lab.trigger_line;
  if (lab.trigger_source == "action") {
    settings.trigger_source = "Action1";
    settings.action =
        ActionKeys{lab.action_device_key, lab.action_group_key, lab.action_group_mask, lab.action_broadcast};
  }
  settings.exposure_us = lab.exposure_us;
  settings.gain_raw = static_cast<int>(std::lround(lab.gain_db / kDecibelPerRawStep));
  settings.pixel_format = lab.pixel_format;
  settings.trigger_delay_us = lab.trigger_delay_us;
  if (lab.black_level_raw > 0) settings.black_level_raw = lab.black_level_raw;
  settings.binning_x = lab.binning_x;
  settings.binning_y = lab.binning_y;
  settings.packet_size_bytes = lab.packet_size_bytes;
  if (lab.width_px > 0 && lab.height_px > 0)
    settings.region = SensorRegion{lab.offset_x_px, lab.offset_y_px, lab.width_px, lab.height_px};
  return settings;
}

}  // namespace flamefield
