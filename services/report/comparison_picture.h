#pragma once

#include <string>

#include "proto/error.h"
#include "proto/volume.h"
#include "reconstruct/metrics.h"
#include "services/report/rgb_image.h"

namespace flamefield {

// Slices of the known and the reconstructed field, one above the other to one scale, correlation and
// normalised distance of each pair printed between (paper Figs. 8 and 9), and their difference below. The
// grids are equal. Drawn by gnuplot: Unavailable when that is missing.
Result<RgbImage> comparison_picture(const Volume& truth, const Volume& volume, const FieldMetrics& metrics,
                                    const std::string& unit);

}  // namespace flamefield
