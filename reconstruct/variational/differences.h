#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "proto/volume.h"
#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"

namespace flamefield {

// A packed volume with a vector of zeros before and after, so that kernels may look one voxel beyond either
// end of any column.
class GuardedVolume {
 public:
  GuardedVolume() = default;
  explicit GuardedVolume(std::size_t voxels) : size_(voxels), values_(voxels + 2 * kGuard, 0.0f) {}
  float* data() { return values_.data() + kGuard; }
  const float* data() const { return values_.data() + kGuard; }
  std::span<float> span() { return {data(), size_}; }
  std::span<const float> span() const { return {data(), size_}; }
  bool empty() const { return size_ == 0; }

 private:
  static constexpr std::size_t kGuard = 16;
  std::size_t size_ = 0;
  std::vector<float> values_;
};

// The difference operators of the priors, on packed volumes. Beyond the faces of the box the field goes on
// flat (Neumann), as in the projector. Differences count per smallest voxel side h: along an axis of spacing
// s they are divided by s / h, so that an edge costs the same whichever way it runs.
//   gradient: forward differences x, y, z
//   Hessian:  second differences xx, yy, zz, and forward mixed ones sqrt(2) times xy, xz, yz, so that the
//             norm over the six is the Frobenius norm
// Both map into "fields" of 3 or 6 guarded volumes.
class Differences {
 public:
  static constexpr std::size_t kGradient = 3, kHessian = 6;

  Differences(const Grid& grid, const Layout& layout);

  // Dual ascent and projection onto balls: p <- P_weight( p + step * D x ), weight > 0.
  void ascend_gradient(Team& team, const GuardedVolume& x, float step, float weight,
                       std::span<GuardedVolume> p) const;
  void ascend_hessian(Team& team, const GuardedVolume& x, float step, float weight,
                      std::span<GuardedVolume> p) const;

  // Adds D^T p in slab z to `out`, which holds that slab only (nx columns).
  void add_gradient_adjoint(int z, std::span<const GuardedVolume> p, float* out) const;
  void add_hessian_adjoint(int z, std::span<const GuardedVolume> p, float* out) const;

  // Sum over voxels of the norm of the gradient or Hessian.
  double gradient_norm(Team& team, const GuardedVolume& x) const;
  double hessian_norm(Team& team, const GuardedVolume& x) const;

  // Largest sums of absolute values in a row and in a column of the operators (Pock and Chambolle's bounds).
  double gradient_row() const, gradient_column() const;
  double hessian_row() const, hessian_column() const;

 private:
  Layout layout_;
  std::array<float, 3> scale_;    // of a first difference along x, y, z
  std::vector<float> below_top_;  // per y, one element earlier: 1 where y + 1 exists
};

}  // namespace flamefield
