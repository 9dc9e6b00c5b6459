#pragma once

#include <vector>

#include "acquire/bandwidth_plan.h"
#include "acquire/settings.h"
#include "services/config/lab_config.h"

namespace flamefield {

// What lab.toml says about the cameras, in the acquisition's terms.
// InvalidInput: the trigger's rate does not fit through the network. Each camera gets its place in the plan.
Result<std::vector<CameraAddress>> planned_cameras_of(const LabConfig& lab);
std::vector<CameraAddress> cameras_of(const LabConfig& lab);
BandwidthNeeds bandwidth_needs_of(const LabConfig& lab);
CameraSettings settings_of(const LabConfig& lab);

}  // namespace flamefield
