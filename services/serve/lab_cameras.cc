#include "services/serve/lab_cameras.h"

#include <cmath>

namespace flamefield {

std::vector<CameraAddress> cameras_of(const LabConfig& lab) {
  std::vector<CameraAddress> out;
  for (const LabCamera& camera : lab.cameras) out.push_back({camera.name, camera.address});
  return out;
}

CameraSettings settings_of(const LabConfig& lab) {
  constexpr double kDecibelPerRawStep = 0.0359;  // of the acA645's GainRaw
  CameraSettings settings;
  settings.trigger_source = lab.trigger_line;
  settings.exposure_us = lab.exposure_us;
  settings.gain_raw = static_cast<int>(std::lround(lab.gain_db / kDecibelPerRawStep));
  settings.pixel_format = lab.pixel_format;
  return settings;
}

}  // namespace flamefield
