#pragma once

#include <vector>

#include "acquire/settings.h"
#include "services/config/lab_config.h"

namespace flamefield {

// What lab.toml says about the cameras, in the acquisition's terms.
std::vector<CameraAddress> cameras_of(const LabConfig& lab);
CameraSettings settings_of(const LabConfig& lab);

}  // namespace flamefield
