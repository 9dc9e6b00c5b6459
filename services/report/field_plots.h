#pragma once

#include <string>

#include "proto/volume.h"
#include "reconstruct/metrics.h"
#include "services/report/plot.h"

namespace flamefield {

// Every voxel of two fields on one grid, the true one to the right: logarithmic density (paper Fig. 17).
Plot scatter_plot(const Volume& truth, const Volume& volume, const std::string& unit);

// Correlation and distance of horizontal slices against the height above the burner (paper Fig. 16).
Plot height_plot(const Grid& grid, const FieldMetrics& metrics);

Volume difference(const Volume& a, const Volume& b);  // a - b, on one grid

}  // namespace flamefield
