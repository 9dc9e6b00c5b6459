#pragma once

#include <vector>

#include "acquire/bandwidth_plan.h"
#include "acquire/settings.h"
#include "services/acquisition/acquisition.h"
#include "services/config/lab_config.h"

namespace flamefield {

// What lab.toml says about the cameras, in the acquisition's terms.
AcquisitionOptions acquisition_of(const LabConfig& lab);  // endpoints are left to the caller
std::vector<CameraAddress> cameras_of(const LabConfig& lab);
BandwidthNeeds bandwidth_needs_of(const LabConfig& lab);
CameraSettings settings_of(const LabConfig& lab);

}  // namespace flamefield
