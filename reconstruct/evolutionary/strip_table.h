#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "reconstruct/evolutionary/ladder.h"
#include "reconstruct/projector.h"

namespace flamefield {

// Four pixels above each other, and what a voxel adds to them.
struct Strip {
  static constexpr std::size_t kPixels = 4;
  std::uint32_t first = 0;  // index into packed images (layout.h)
  std::array<float, kPixels> weight = {};
};

// Columns of A in strips, which can be worked on without gathering. Images must have Strip::kPixels floats to
// spare at their end. Columns are stored if they fit the budget, else worked out at every use.
class StripTable {
 public:
  // scale: of all weights, so that voxels may count in [0, 1].
  StripTable(const Projector& projector, float scale, double budget_mib, Team& team);

  // Columns of A P, with P the interpolation of a ladder's coarse grid onto `fine`'s: a change of a coarse
  // voxel has the same images as that of the fine voxels it stands for.
  // Columns are left empty where the coarse `density` is 0.
  StripTable(const StripTable& fine, const Interpolation& interpolation, std::span<const float> density,
             Team& team);

  std::size_t voxels() const { return voxels_; }
  bool is_stored() const { return !start_.empty(); }
  std::size_t image_floats() const { return image_floats_; }  // with what is to spare
  std::span<const Strip> of(std::size_t voxel, std::vector<Strip>& scratch) const;

 private:
  void work_out(std::size_t voxel, std::vector<Strip>& strips) const;
  void store(std::vector<std::vector<Strip>>& parts, std::vector<std::size_t>& sizes);

  const Projector* projector_ = nullptr;
  float scale_ = 1;
  std::size_t voxels_ = 0, image_floats_ = 0;
  std::vector<std::size_t> start_;  // (voxels + 1)
  std::vector<Strip> strips_;
};

}  // namespace flamefield
