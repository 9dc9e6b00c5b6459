// Compiled once for every instruction set; the best one the machine has is chosen when it runs.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reconstruct/variational/prior_kernels.cc"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "reconstruct/variational/prior_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace flamefield {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Float = hn::CappedTag<float, 16>;  // columns are padded to 16
using V = hn::Vec<Float>;
constexpr Float kF{};
constexpr hn::RebindToSigned<Float> kI{};
constexpr std::size_t kLanes = hn::MaxLanes(kF);

HWY_INLINE V load(const float* at) {
  return hn::LoadU(kF, at);
}
HWY_INLINE V set(float value) {
  return hn::Set(kF, value);
}
// Voxels y - 1 of a column; below its bottom zero, not what lies there: another thread may be writing it.
HWY_INLINE V below(const float* column, std::size_t y) {
  if (y > 0) return load(column + y - 1);
  const auto lane = hn::Iota(kI, 0), zero = hn::Zero(kI);
  const auto shifted = hn::IndicesFromVec(kF, hn::Max(zero, hn::Sub(lane, hn::Set(kI, 1))));
  return hn::IfThenElseZero(hn::RebindMask(kF, hn::Gt(lane, zero)),
                            hn::TableLookupLanes(load(column), shifted));
}

// First voxels of the columns around column (x, z); where the box ends, of the column itself.
struct Around {
  const float *at, *left, *right, *front, *back, *right_back;
  Around(const PriorShape& s, const float* v, int x, int z) {
    const auto column = [&](int i, int k) {
      return v +
             (static_cast<std::size_t>(k) * static_cast<std::size_t>(s.nx) + static_cast<std::size_t>(i)) *
                 s.column;
    };
    const int next_x = x + 1 < s.nx ? x + 1 : x, next_z = z + 1 < s.nz ? z + 1 : z;
    at = column(x, z);
    left = column(x > 0 ? x - 1 : x, z);
    right = column(next_x, z);
    front = column(x, z > 0 ? z - 1 : z);
    back = column(x, next_z);
    right_back = column(next_x, next_z);
  }
};

// First voxels of the columns before column (x, z), zeros where the box ends.
struct Before {
  const float *at, *left, *front, *left_front;
  Before(const PriorShape& s, const float* v, int x, int z) {
    const std::size_t slab = static_cast<std::size_t>(s.nx) * s.column;
    at = v + static_cast<std::size_t>(z) * slab + static_cast<std::size_t>(x) * s.column;
    left = x > 0 ? at - s.column : s.zeros;
    front = z > 0 ? at - slab : s.zeros;
    left_front = x > 0 && z > 0 ? at - slab - s.column : s.zeros;
  }
};

// Of the differences in the order of the duals, times `step`.
HWY_INLINE void scales_of(const PriorShape& s, float step, V (&scale)[3]) {
  for (std::size_t axis = 0; axis < 3; ++axis) scale[axis] = set(step * s.scale[axis]);
}
HWY_INLINE void scales_of(const PriorShape& s, float step, V (&scale)[6]) {
  const float root = 1.41421356f * step;
  for (std::size_t axis = 0; axis < 3; ++axis) scale[axis] = set(step * s.scale[axis] * s.scale[axis]);
  scale[3] = set(root * s.scale[0] * s.scale[1]);
  scale[4] = set(root * s.scale[0] * s.scale[2]);
  scale[5] = set(root * s.scale[1] * s.scale[2]);
}

template <std::size_t kFields>
HWY_INLINE V norm(const V (&p)[kFields]) {
  V square = hn::Mul(p[0], p[0]);
  for (std::size_t i = 1; i < kFields; ++i) square = hn::MulAdd(p[i], p[i], square);
  return hn::Sqrt(square);
}

// Differences at voxel y of a column, not yet scaled.
HWY_INLINE void gradient_at(const PriorShape& s, const Around& v, std::size_t y, V (&d)[3]) {
  const V c = load(v.at + y);
  d[0] = hn::Sub(load(v.right + y), c);
  d[1] = hn::Mul(load(s.below_top + y), hn::Sub(load(v.at + y + 1), c));
  d[2] = hn::Sub(load(v.back + y), c);
}

HWY_INLINE void hessian_at(const PriorShape& s, const Around& v, std::size_t y, V (&d)[6]) {
  const V top = load(s.below_top + y), top_before = load(s.below_top + y - 1);
  const V c = load(v.at + y), right = load(v.right + y), back = load(v.back + y);
  const V up = hn::Mul(top, hn::Sub(load(v.at + y + 1), c));
  const V down = hn::Mul(top_before, hn::Sub(c, load(v.at + y - 1)));
  const V to_right = hn::Sub(right, c), to_back = hn::Sub(back, c);
  d[0] = hn::Sub(to_right, hn::Sub(c, load(v.left + y)));
  d[1] = hn::Sub(up, down);
  d[2] = hn::Sub(to_back, hn::Sub(c, load(v.front + y)));
  d[3] = hn::Sub(hn::Mul(top, hn::Sub(load(v.right + y + 1), right)), up);
  d[4] = hn::Sub(hn::Sub(load(v.right_back + y), back), to_right);
  d[5] = hn::Sub(hn::Mul(top, hn::Sub(load(v.back + y + 1), back)), up);
}

template <std::size_t kFields>
HWY_INLINE void differences_at(const PriorShape& s, const Around& v, std::size_t y, V (&d)[kFields]) {
  if constexpr (kFields == 3)
    gradient_at(s, v, y, d);
  else
    hessian_at(s, v, y, d);
}

template <std::size_t kFields>
HWY_INLINE void ascend(const PriorShape& s, int z, const float* values, const DualStep& step,
                       const std::array<float*, kFields>& dual) {
  V scale[kFields], d[kFields];
  scales_of(s, step.length, scale);
  const V weight = set(step.weight), reach = set(step.weight * step.relaxation),
          kept = set(1 - step.relaxation);
  for (int x = 0; x < s.nx; ++x) {
    const Around v(s, values, x, z);
    const auto from = static_cast<std::size_t>(v.at - values);
    for (std::size_t y = 0; y < s.column; y += kLanes) {
      differences_at(s, v, y, d);
      for (std::size_t i = 0; i < kFields; ++i) d[i] = hn::MulAdd(scale[i], d[i], load(dual[i] + from + y));
      const V shrink = hn::Div(reach, hn::Max(norm(d), weight));
      for (std::size_t i = 0; i < kFields; ++i) {
        float* at = dual[i] + from + y;
        hn::StoreU(hn::MulAdd(shrink, d[i], hn::Mul(kept, load(at))), kF, at);
      }
    }
  }
}

template <std::size_t kFields>
HWY_INLINE double sum_of_norms(const PriorShape& s, int z, const float* values) {
  V scale[kFields], d[kFields];
  scales_of(s, 1, scale);
  double sum = 0;
  for (int x = 0; x < s.nx; ++x) {
    const Around v(s, values, x, z);
    V column = hn::Zero(kF);
    for (std::size_t y = 0; y < s.column; y += kLanes) {
      differences_at(s, v, y, d);
      for (std::size_t i = 0; i < kFields; ++i) d[i] = hn::Mul(scale[i], d[i]);
      column = hn::Add(column, norm(d));
    }
    sum += static_cast<double>(hn::GetLane(hn::SumOfLanes(kF, column)));
  }
  return sum;
}

void AscendGradient(const PriorShape& s, int z, const float* x, const DualStep& step,
                    const GradientDual& dual) {
  ascend(s, z, x, step, dual);
}
void AscendHessian(const PriorShape& s, int z, const float* x, const DualStep& step,
                   const HessianDual& dual) {
  ascend(s, z, x, step, dual);
}
double GradientNorm(const PriorShape& s, int z, const float* x) {
  return sum_of_norms<3>(s, z, x);
}
double HessianNorm(const PriorShape& s, int z, const float* x) {
  return sum_of_norms<6>(s, z, x);
}

// Second differences with flat ends are their own transpose. A first difference, mixed ones too, has a zero
// dual where it would leave the box.
struct HessianColumns {
  Around xx, zz;
  const float* yy;
  Before xy, xz, yz;
  HessianColumns(const PriorShape& s, const HessianDual& p, int x, int z)
      : xx(s, p[0], x, z),
        zz(s, p[2], x, z),
        yy(Before(s, p[1], x, z).at),
        xy(s, p[3], x, z),
        xz(s, p[4], x, z),
        yz(s, p[5], x, z) {}

  HWY_INLINE V adjoint(const PriorShape& s, const V (&scale)[6], std::size_t y) const {
    const auto second = [&](const float* before, const float* at, const float* after) {
      const V c = load(at + y);
      return hn::Sub(hn::Sub(load(after + y), c), hn::Sub(c, load(before + y)));
    };
    const auto fall = [&](const float* column) { return hn::Sub(load(column + y), below(column, y)); };
    const V c = load(yy + y);
    const V along_y = hn::Sub(hn::Mul(load(s.below_top + y), hn::Sub(load(yy + y + 1), c)),
                              hn::Mul(load(s.below_top + y - 1), hn::Sub(c, below(yy, y))));
    V sum = hn::Mul(scale[0], second(xx.left, xx.at, xx.right));
    sum = hn::MulAdd(scale[1], along_y, sum);
    sum = hn::MulAdd(scale[2], second(zz.front, zz.at, zz.back), sum);
    sum = hn::MulAdd(scale[3], hn::Sub(fall(xy.at), fall(xy.left)), sum);
    sum = hn::MulAdd(scale[5], hn::Sub(fall(yz.at), fall(yz.front)), sum);
    return hn::MulAdd(scale[4],
                      hn::Sub(hn::Sub(load(xz.at + y), load(xz.left + y)),
                              hn::Sub(load(xz.front + y), load(xz.left_front + y))),
                      sum);
  }
};

struct GradientColumns {
  Before x, y, z;
  GradientColumns(const PriorShape& s, const GradientDual& p, int i, int k)
      : x(s, p[0], i, k), y(s, p[1], i, k), z(s, p[2], i, k) {}

  HWY_INLINE V adjoint(const V (&scale)[3], std::size_t at) const {
    V sum = hn::Mul(scale[0], hn::Sub(load(x.left + at), load(x.at + at)));
    sum = hn::MulAdd(scale[1], hn::Sub(below(y.at, at), load(y.at + at)), sum);
    return hn::MulAdd(scale[2], hn::Sub(load(z.front + at), load(z.at + at)), sum);
  }
};

// Calls use(index of the first voxel, D^T dual there) along the slab.
template <bool kGradient, bool kHessian, class Use>
HWY_INLINE void each_adjoint(const PriorShape& s, int z, const PriorDuals& duals, const Use& use) {
  V first[3], second[6];
  scales_of(s, 1, first);
  scales_of(s, 1, second);
  for (int x = 0; x < s.nx; ++x) {
    [[maybe_unused]] const auto gradient = [&] {
      if constexpr (kGradient)
        return GradientColumns(s, *duals.gradient, x, z);
      else
        return 0;
    }();
    [[maybe_unused]] const auto hessian = [&] {
      if constexpr (kHessian)
        return HessianColumns(s, *duals.hessian, x, z);
      else
        return 0;
    }();
    const std::size_t from =
        (static_cast<std::size_t>(z) * static_cast<std::size_t>(s.nx) + static_cast<std::size_t>(x)) *
        s.column;
    for (std::size_t y = 0; y < s.column; y += kLanes) {
      V sum = hn::Zero(kF);
      if constexpr (kHessian) sum = hessian.adjoint(s, second, y);
      if constexpr (kGradient) sum = hn::Add(sum, gradient.adjoint(first, y));
      use(from + y, sum);
    }
  }
}

template <class Use>
HWY_INLINE void each_adjoint_of(const PriorShape& s, int z, const PriorDuals& duals, const Use& use) {
  if (duals.hessian && duals.gradient) {
    each_adjoint<true, true>(s, z, duals, use);
  } else if (duals.hessian) {
    each_adjoint<false, true>(s, z, duals, use);
  } else if (duals.gradient) {
    each_adjoint<true, false>(s, z, duals, use);
  } else {
    each_adjoint<false, false>(s, z, duals, use);
  }
}

void ApplyAdjoint(const PriorShape& s, int z, const PriorDuals& duals, float* out) {
  each_adjoint_of(s, z, duals, [&](std::size_t at, V sum) { hn::StoreU(sum, kF, out + at); });
}

void Descend(const PriorShape& s, int z, const PriorDuals& duals, const PrimalStep& step) {
  const V h = set(step.h), sparsity = set(step.sparsity), floor = set(step.floor);
  const V relaxation = set(step.relaxation);
  each_adjoint_of(s, z, duals, [&](std::size_t at, V sum) {
    const V x = load(step.x + at);
    const V slope = hn::MulAdd(h, hn::Add(sum, sparsity), load(step.data + (at - step.before)));
    const V next = hn::Max(hn::NegMulAdd(load(step.step + (at - step.before)), slope, x), floor);
    hn::StoreU(hn::Sub(hn::Add(next, next), x), kF, step.bar + at);
    hn::StoreU(hn::MulAdd(relaxation, hn::Sub(next, x), x), kF, step.x + at);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace flamefield
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace flamefield {

HWY_EXPORT(AscendGradient);
HWY_EXPORT(AscendHessian);
HWY_EXPORT(GradientNorm);
HWY_EXPORT(HessianNorm);
HWY_EXPORT(ApplyAdjoint);
HWY_EXPORT(Descend);

void ascend_gradient(const PriorShape& shape, int z, const float* x, const DualStep& step,
                     const GradientDual& dual) {
  HWY_DYNAMIC_DISPATCH(AscendGradient)(shape, z, x, step, dual);
}
void ascend_hessian(const PriorShape& shape, int z, const float* x, const DualStep& step,
                    const HessianDual& dual) {
  HWY_DYNAMIC_DISPATCH(AscendHessian)(shape, z, x, step, dual);
}
double gradient_norm(const PriorShape& shape, int z, const float* x) {
  return HWY_DYNAMIC_DISPATCH(GradientNorm)(shape, z, x);
}
double hessian_norm(const PriorShape& shape, int z, const float* x) {
  return HWY_DYNAMIC_DISPATCH(HessianNorm)(shape, z, x);
}
void apply_adjoint(const PriorShape& shape, int z, const PriorDuals& duals, float* out) {
  HWY_DYNAMIC_DISPATCH(ApplyAdjoint)(shape, z, duals, out);
}
void descend(const PriorShape& shape, int z, const PriorDuals& duals, const PrimalStep& step) {
  HWY_DYNAMIC_DISPATCH(Descend)(shape, z, duals, step);
}

}  // namespace flamefield
#endif
