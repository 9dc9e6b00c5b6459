#pragma once

#include <array>
#include <cstddef>

namespace flamefield {

// The inner loops of the priors, each over one plane z of a packed volume. Pointers are to the first voxel of
// a guarded volume.
struct PriorShape {
  int nx = 0, nz = 0;
  std::size_t column = 0;            // floats
  std::array<float, 3> scale = {};   // of a first difference along x, y, z
  const float* below_top = nullptr;  // per y, from -1 on: 1 where voxels y and y + 1 exist, else 0
  const float* zeros = nullptr;      // a guarded column of zeros
};

using GradientDual = std::array<float*, 3>;  // x, y, z
using HessianDual = std::array<float*, 6>;   // xx, yy, zz, sqrt(2) times xy, xz, yz

struct DualStep {
  float length = 0, weight = 0;
  float relaxation = 1;  // how far to go towards the new dual; above 1: beyond it
};

// dual <- dual + relaxation (onto the ball of radius `weight`( dual + length * D x ) - dual)
void ascend_gradient(const PriorShape& shape, int z, const float* x, const DualStep& step,
                     const GradientDual& dual);
void ascend_hessian(const PriorShape& shape, int z, const float* x, const DualStep& step,
                    const HessianDual& dual);

// Sums of |D x| over the slab.
double gradient_norm(const PriorShape& shape, int z, const float* x);
double hessian_norm(const PriorShape& shape, int z, const float* x);

// The adjoints of both operators, added up; an operator without a dual (null) is off.
struct PriorDuals {
  const GradientDual* gradient = nullptr;
  const HessianDual* hessian = nullptr;
};

// out <- D^T dual, this slab only
void apply_adjoint(const PriorShape& shape, int z, const PriorDuals& duals, float* out);

struct PrimalStep {
  float h = 0, sparsity = 0, floor = 0;
  float relaxation = 1;         // as of a DualStep
  const float* data = nullptr;  // A^T y
  const float* step = nullptr;
  std::size_t before = 0;  // floats of x, bar and duals before the first that data and step begin with
  float* x = nullptr;
  float* bar = nullptr;
};

// next = max(x - step (data + h (D^T dual + sparsity)), floor); bar <- 2 next - x; x <- x + relaxation (next
// - x)
void descend(const PriorShape& shape, int z, const PriorDuals& duals, const PrimalStep& step);

}  // namespace flamefield
