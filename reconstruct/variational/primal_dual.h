#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/variational/differences.h"

namespace flamefield {

// Weights of the priors, in units of the brightest pixel; 0 switches a prior off. They do not depend on the
// length unit, the number of views or the pixels per voxel, see PrimalDual.
struct PriorWeights {
  double variation = 0;  // of the gradient's norm
  double hessian = 0;    // of the Hessian's norm
  double sparsity = 0;   // of the field itself
};

// How far a pair of primal and dual variables is from the solution.
struct DualityGap {
  double primal = 0, dual = 0;  // objective values; the optimum lies between
  double gap() const { return primal - dual; }
};

// Diagonally preconditioned primal-dual iteration (Pock and Chambolle, ICCV 2011), over-relaxed (Condat, J.
// Optim. Theory Appl. 158, 2013), for
//
//   min over x >= 0 in the support:  1/(2n) |Ax - b|^2 + variation TV(h x) + hessian |Hess(h x)|_(2,1)
//                                    + sparsity |h x|_1
//
// x has the unit of (image unit)/mm and h is the smallest voxel side, so that h x counts in image units. n is
// the mean column sum of A / h: how many pixels, over all views, look at a voxel.
class PrimalDual {
 public:
  // Begins at the problem's warm start. problem must outlive this. Voxels that no ray meets are dark.
  explicit PrimalDual(const Problem& problem);

  // May change between iterations: the variables are kept, as a warm start.
  void set_weights(const PriorWeights& weights);
  const PriorWeights& weights() const { return weights_; }

  // relaxation in (0, 2): how far to go towards where the plain iteration would be; above 1: beyond it, which
  // is faster by about that factor. After a plain one (1) the field keeps its constraints and the gap is
  // valid.
  void iterate(float relaxation = 1);

  std::span<const float> field() const { return differences_.held(x_); }  // x
  std::span<const float> images() const { return ax_; }                   // A x, packed
  double residual_square() const { return residual_square_; }    // |Ax - b|^2 where the plain one would be
  double pixels_per_voxel() const { return pixels_per_voxel_; }  // n

  // Costs less than an iteration. The dual variable is made feasible by a constant added to all pixels, so
  // that the gap is finite at any time; it is infinite when x may be negative.
  DualityGap gap();

 private:
  void ascend_data(float relaxation);
  void project_forward(float relaxation);  // from x_bar_: A x_bar, A x and the residual

  const Problem& problem_;
  const Layout& layout_;
  const Share& share_;
  Differences differences_;
  PriorWeights weights_;
  double h_mm_ = 1;
  double pixels_per_voxel_ = 1;
  double balance_ = 1;                     // of the step lengths
  std::vector<float> row_, column_;        // sums of A
  std::vector<float> step_;                // of the primal, per voxel; 0 where x stays 0
  std::vector<float> ax_, ax_bar_, dual_;  // packed images
  std::vector<float> descent_;             // A^T dual, packed volume
  GuardedVolume x_, x_bar_, next_bar_;
  Differences::Dual gradient_dual_, hessian_dual_;  // empty: that prior is off
  double residual_square_ = 0;
};

}  // namespace flamefield
