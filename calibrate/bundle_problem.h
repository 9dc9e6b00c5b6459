#pragma once

#include <ceres/problem.h>

#include <algorithm>
#include <cstddef>
#include <vector>

#include "calibrate/bundle.h"
#include "calibrate/reprojection.h"

namespace flamefield {

// The bundle's unknowns as Ceres wants them. One piece of memory, boards first: Ceres sorts blocks by their
// address, and sums in that order, so that the last digits would differ from run to run otherwise.
class Blocks {
 public:
  explicit Blocks(const Bundle& bundle);

  std::size_t boards() const { return boards_; }
  std::size_t cameras() const { return cameras_; }
  double* board(std::size_t p) { return &values_[kPose * p]; }
  double* camera(std::size_t c) { return &values_[kPose * boards_ + kCamera * c]; }
  double* lens(std::size_t c) { return camera(c) + kPose; }
  double* bow() { return &values_[kPose * boards_ + kCamera * cameras_]; }

  Rigid3 board_pose(std::size_t p) { return rigid3_from(copied<PoseBlock>(board(p))); }
  Rigid3 camera_pose(std::size_t c) { return rigid3_from(copied<PoseBlock>(camera(c))); }
  LensBlock lens_of(std::size_t c) { return copied<LensBlock>(lens(c)); }

 private:
  template <class Block>
  static Block copied(const double* from) {
    Block block;
    std::copy_n(from, block.size(), block.begin());
    return block;
  }
  static constexpr std::size_t kPose = 8, kCamera = kPose + 10;  // padded, as vector instructions like them
  std::size_t boards_, cameras_;
  std::vector<double> values_;
};

// Lens parameters that are not estimated (see LensIndex).
std::vector<int> constant_lens_indices(const BundleOptions& options);
bool estimates_bow(const BundleOptions& options);

// Fills the problem, which keeps pointers into `blocks`; returns the views' residuals, one list for each
// view.
std::vector<std::vector<ceres::ResidualBlockId>> build(ceres::Problem& problem, const Bundle& bundle,
                                                       const BundleOptions& options, Blocks& blocks);

}  // namespace flamefield
