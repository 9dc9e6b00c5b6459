#pragma once

#include <string>

namespace flamefield {

// The GenICam file of the simulated camera: the features of a Basler acA645-100gm that an array needs, over
// the registers of registers.h. Sizes are the sensor's.
std::string genicam_xml(int sensor_width_px, int sensor_height_px, bool has_ptp);

}  // namespace flamefield
