#pragma once

#include <array>
#include <vector>

#include "proto/volume.h"
#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"
#include "reconstruct/variational/guarded_volume.h"
#include "reconstruct/variational/prior_kernels.h"

namespace flamefield {

// The difference operators D of the priors, on packed volumes. Beyond the faces of the box the field goes on
// flat (Neumann), as in the projector. Differences count per smallest voxel side h: along an axis of spacing
// s they are divided by s / h, so that an edge costs the same whichever way it runs.
//   gradient: forward differences x, y, z
//   Hessian:  second differences xx, yy, zz, and forward mixed ones, sqrt(2) times xy, xz, yz, so that the
//             norm over the six is the Frobenius norm
class Differences {
 public:
  static constexpr std::size_t kGradient = 3, kHessian = 6;

  Differences(const Grid& grid, const Layout& layout);

  // One field a component; no fields: the operator is off.
  using Dual = std::vector<GuardedVolume>;
  Dual make_dual(std::size_t fields) const;
  struct Ascent {
    Dual& dual;
    DualStep step;
  };

  // The dual steps from D x_bar for both operators, then the primal step with their
  // adjoints. descent.bar must not be x_bar.
  void iterate(Team& team, const GuardedVolume& x_bar, const Ascent& gradient, const Ascent& hessian,
               const PrimalStep& descent) const;

  // out = D^T dual, both added up
  void adjoint(Team& team, Dual& gradient, Dual& hessian, GuardedVolume& out) const;

  // Sum over voxels of the norm of the gradient or Hessian.
  double gradient_norm(Team& team, const GuardedVolume& x) const;
  double hessian_norm(Team& team, const GuardedVolume& x) const;

  // Largest sums of absolute values in a row and in a column of the operators (Pock and Chambolle's bounds).
  double gradient_row() const, gradient_column() const;
  double hessian_row() const, hessian_column() const;

 private:
  PriorShape shape() const;

  Layout layout_;
  std::array<float, 3> scale_;    // of a first difference along x, y, z
  std::vector<float> below_top_;  // see PriorShape
  std::vector<float> zeros_;
};

}  // namespace flamefield
