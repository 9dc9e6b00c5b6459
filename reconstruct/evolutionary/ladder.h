#pragma once

#include <array>
#include <span>
#include <vector>

#include "proto/volume.h"

namespace flamefield {

// Twice as large voxels over the same box; one more where their number is odd.
Grid halved(const Grid& grid);

// P: linear interpolation between the voxel centres of a halved grid and its fine one, flat beyond the
// outermost centres.
class Interpolation {
 public:
  explicit Interpolation(const Grid& fine);

  const Grid& fine() const { return fine_; }
  const Grid& coarse() const { return coarse_; }

  // visit(fine voxel, share) for all fine voxels that a coarse one takes part in.
  template <class Visit>
  void visit(std::size_t voxel, const Visit& visitor) const {
    const auto nx = static_cast<std::size_t>(coarse_.nx), ny = static_cast<std::size_t>(coarse_.ny);
    for (const Share& z : shares_[2][voxel / (nx * ny)])
      for (const Share& y : shares_[1][voxel / nx % ny])
        for (const Share& x : shares_[0][voxel % nx])
          visitor(fine_.index(x.fine, y.fine, z.fine), x.weight * y.weight * z.weight);
  }

  std::vector<float> prolong(std::span<const float> coarse) const;       // P x
  std::vector<float> largest_within(std::span<const float> fine) const;  // of each coarse voxel's fine ones

 private:
  struct Share {
    int fine;
    float weight;
  };
  using Axis = std::vector<std::vector<Share>>;  // of each coarse index
  static Axis axis(int fine, int coarse);

  Grid fine_, coarse_;
  std::array<Axis, 3> shares_;
};

}  // namespace flamefield
