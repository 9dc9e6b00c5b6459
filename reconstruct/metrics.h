#pragma once

#include <array>
#include <vector>

#include "proto/image.h"
#include "proto/volume.h"

namespace flamefield {

struct SliceMetrics {
  int index = 0;       // of the slice along its axis
  double pearson = 0;  // NaN when one of the slices is constant
  double sqmd = 0;     // NaN when the true slice is all zero
};

// How close a reconstruction R is to the truth P (same grid).
struct FieldMetrics {
  double pearson = 0;  // correlation coefficient over all voxels
  double sqmd = 0;     // squared Manhattan distance |R - P|_1^2 / |P|_1^2 (paper Eq. 5)
  double rmse = 0;     // field unit
  double psnr_db = 0;  // peak = max P; NaN when that is 0, infinite when R = P
  double ssim = 0;     // mean over y-slices, 7 x 7 windows, range = max P; NaN when that is 0
  std::array<std::vector<SliceMetrics>, 3> slices;  // normal to x, y, z
};
// InvalidInput: grids differ, or a voxel is NaN or infinite.
Result<FieldMetrics> compare(const Volume& truth, const Volume& reconstruction);

// Volume resampled to another grid: the average over each target cell of the trilinear field. Truths are made
// finer than reconstructions, and compared on the coarser grid.
Volume resample(const Volume& volume, const Grid& grid);

// Mean over views of the squared Manhattan distance of images; dark views, where it is undefined, are left
// out.
double mean_sqmd(const Projections& reference, const Projections& rendered);
// |rendered - reference| / |reference| of each view; infinite where a dark view was rendered lit.
std::vector<double> residual_per_view(const Projections& reference, const Projections& rendered);

}  // namespace flamefield
