#pragma once

#include <array>
#include <vector>

#include "proto/volume.h"
#include "reconstruct/layout.h"
#include "reconstruct/parallel.h"
#include "reconstruct/share.h"
#include "reconstruct/variational/guarded_volume.h"
#include "reconstruct/variational/prior_kernels.h"

namespace flamefield {

// The difference operators D of the priors, on packed volumes. Beyond the faces of the box the field goes on
// flat (Neumann), as in the projector. Differences count per smallest voxel side h: along an axis of spacing
// s they are divided by s / h, so that an edge costs the same whichever way it runs.
//   gradient: forward differences x, y, z
//   Hessian:  second differences xx, yy, zz, and forward mixed ones, sqrt(2) times xy, xz, yz, so that the
//             norm over the six is the Frobenius norm
//
// Of a shared volume, fields have room for the neighbouring planes that other ranks hold: make_field().
class Differences {
 public:
  static constexpr std::size_t kGradient = 3, kHessian = 6;

  Differences(const Share& share, const Layout& layout);  // of the planes held

  GuardedVolume make_field() const { return GuardedVolume(stored_.voxels()); }
  // What of a field is held here.
  std::span<float> held(GuardedVolume& field) const {
    return field.span().subspan(before(), layout_.voxels());
  }
  std::span<const float> held(const GuardedVolume& field) const {
    return field.span().subspan(before(), layout_.voxels());
  }

  // One field a component; no fields: the operator is off.
  using Dual = std::vector<GuardedVolume>;
  Dual make_dual(std::size_t fields) const;
  struct Ascent {
    Dual& dual;
    DualStep step;
  };

  // The dual steps from D x_bar for both operators, then the primal step with their adjoints. descent.bar
  // must not be x_bar; descent.data and .step are of the planes held alone. Other ranks' planes come and go.
  void iterate(Team& team, GuardedVolume& x_bar, const Ascent& gradient, const Ascent& hessian,
               PrimalStep descent) const;

  // out = D^T dual, both added up; after iterate()
  void adjoint(Team& team, Dual& gradient, Dual& hessian, GuardedVolume& out) const;

  // Sum over voxels of the norm of the gradient or Hessian.
  double gradient_norm(Team& team, GuardedVolume& x) const;
  double hessian_norm(Team& team, GuardedVolume& x) const;

  // Largest sums of absolute values in a row and in a column of the operators (Pock and Chambolle's bounds).
  double gradient_row() const, gradient_column() const;
  double hessian_row() const, hessian_column() const;

 private:
  PriorShape shape() const;
  std::size_t plane() const { return static_cast<std::size_t>(layout_.nx) * layout_.column; }
  std::size_t before() const { return held_.begin > 0 ? plane() : 0; }
  void pass_behind(GuardedVolume& field) const;  // planes change hands, see Share
  void pass_before(GuardedVolume& field) const;
  void complete(GuardedVolume& field) const;  // both
  void complete_duals(Dual& gradient, Dual& hessian) const;

  Share share_;
  Layout layout_, stored_;        // of the planes held; with those of the neighbours
  Planes held_;                   // of the stored ones
  std::array<float, 3> scale_;    // of a first difference along x, y, z
  std::vector<float> below_top_;  // see PriorShape
  std::vector<float> zeros_;
};

}  // namespace flamefield
