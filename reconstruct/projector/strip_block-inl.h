// Weights and borders of strips, in vectors. Included once for every instruction set.
#if defined(FLAMEFIELD_STRIP_BLOCK_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef FLAMEFIELD_STRIP_BLOCK_INL_H
#undef FLAMEFIELD_STRIP_BLOCK_INL_H
#else
#define FLAMEFIELD_STRIP_BLOCK_INL_H
#endif

#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "reconstruct/projector/column_kernels.h"

HWY_BEFORE_NAMESPACE();
namespace flamefield {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
using Float = hn::ScalableTag<float>;
using Int = hn::RebindToSigned<Float>;
using V = hn::Vec<Float>;
using VI = hn::Vec<Int>;
constexpr Float kF{};
constexpr Int kI{};
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kF));

HWY_INLINE V set(double value) {
  return hn::Set(kF, static_cast<float>(value));
}

// Towards zero, for values known to fit; the general conversion spends instructions on overflow.
HWY_INLINE VI truncate(V value) {
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
  return VI{_mm512_cvttps_epi32(value.raw)};
#elif HWY_TARGET == HWY_AVX2
  return VI{_mm256_cvttps_epi32(value.raw)};
#else
  return hn::ConvertTo(kI, value);
#endif
}

// Two neighbouring vectors in registers, and any of their lanes.
struct Window {
  V low, high;
  HWY_INLINE explicit Window(const float* HWY_RESTRICT at)
      : low(hn::LoadU(kF, at)), high(hn::LoadU(kF, at + kLanes)) {}
  // Lanes `index`, where 0 <= index < 2 x lanes.
  HWY_INLINE V operator[](VI index) const {
#if HWY_TARGET == HWY_AVX3 || HWY_TARGET == HWY_AVX3_DL
    return V{_mm512_permutex2var_ps(low.raw, index.raw, high.raw)};
#else
    const VI lanes = hn::Set(kI, kLanes);
    const auto in_low = hn::Lt(index, lanes);
    const auto at = hn::IndicesFromVec(kF, hn::IfThenElse(in_low, index, hn::Sub(index, lanes)));
    return hn::IfThenElse(hn::RebindMask(kF, in_low), hn::TableLookupLanes(low, at),
                          hn::TableLookupLanes(high, at));
#endif
  }
};

// Lanes index + shift for shift = 0 .. kCount - 1: within one window when the indices leave room, else from
// windows further up.
template <int kCount, bool kRoom>
HWY_INLINE void look_up(const float* HWY_RESTRICT at, VI index, V (&out)[kCount]) {
  if constexpr (kRoom) {
    const Window window(at);
    for (int t = 0; t < kCount; ++t) {
      out[t] = window[index];
      index = hn::Add(index, hn::Set(kI, 1));
    }
  } else {
    for (int t = 0; t < kCount; ++t) out[t] = Window(at + t)[index];
  }
}

// Strips that are resampled as one: `count` (1 or 2) from `lane`, of a pixel column of the patch, on planes
// of the patch from `plane`.
struct Alike {
  int lane = 0, count = 0, col = 0, plane = 0;
};

// Weights and borders of the strips of a patch.
struct Block {
  HWY_ALIGN float weight[4][kPatch];    // of neighbouring voxel columns from `column`
  HWY_ALIGN std::int32_t used[kPatch];  // 0: nothing is seen
  HWY_ALIGN std::int32_t column[kPatch];
  HWY_ALIGN float m[kPatch], per_voxel[kPatch];                    // height of a pixel, voxels; 1 / m
  HWY_ALIGN float half[kPatch], half_px[kPatch];                   // that it averages over, voxels and px
  HWY_ALIGN float bump2[kPatch];                                   // 1 / 4 half
  HWY_ALIGN float from[kPatch], to[kPatch];                        // lower and upper face of the box, px
  HWY_ALIGN std::int32_t first[kPatch], last[kPatch];              // pixels that see something
  HWY_ALIGN std::int32_t whole_first[kPatch], whole_last[kPatch];  // pixels that see nothing but the box
  const StripPatch& patch;
  const StripShape& shape;
  int columns;  // that have weight in any strip

  // begin, end: the voxel columns that matter.
  HWY_INLINE Block(const StripPatch& strips, const StripShape& strip_shape, int begin, int end)
      : patch(strips), shape(strip_shape) {
    V widest = hn::Zero(kF);
    for (int i = 0; i < patch.strips(); i += kLanes) {
      weigh_columns(i);
      find_borders(i);
      widest = hn::Max(widest, hn::LoadU(kF, patch.half + i));
    }
    const float half_width = hn::GetLane(hn::MaxOfLanes(kF, widest));
    columns = half_width > 0.5f ? 4 : half_width > 0 ? 3 : 2;
    for (int i = 0; i < patch.strips(); i += kLanes) {
      const VI at = hn::Load(kI, column + i), low = hn::Set(kI, begin), high = hn::Set(kI, end - columns);
      if (hn::AllFalse(kI, hn::Or(hn::Lt(at, low), hn::Gt(at, high)))) continue;
      for (int lane = i; lane < i + kLanes; ++lane) fit(lane, begin, end);
    }
  }

  // footprint.h: linear interpolation, and the bump on second differences; columns n - 1 .. n + 2, n =
  // floor(q).
  HWY_INLINE void weigh_columns(int i) {
    const V zero = hn::Zero(kF), one = set(1), two = set(2), quarter = set(0.25), tiny = set(1e-6);
    const V q = hn::LoadU(kF, patch.q + i), h = hn::LoadU(kF, patch.half + i);
    const V n = hn::Floor(q), f = hn::Sub(q, n), scale = hn::Div(quarter, hn::Max(h, tiny));
    const V u = hn::Max(zero, hn::Sub(h, f)), v = hn::Max(zero, hn::Add(hn::Sub(h, one), f));
    const V s0 = hn::Mul(scale, hn::Mul(u, u)), s1 = hn::Mul(scale, hn::Mul(v, v));
    const V inside =
        hn::Sub(hn::Min(hn::Add(q, h), set(shape.others - 0.5)), hn::Max(hn::Sub(q, h), set(-0.5)));
    const V width = hn::Add(h, h);
    const V share =
        hn::IfThenElse(hn::Gt(h, zero), hn::Div(hn::Max(zero, hn::Min(inside, width)), hn::Max(width, tiny)),
                       hn::IfThenElseZero(hn::Ge(inside, zero), one));
    const V w0 = hn::Mul(share, s0), w3 = hn::Mul(share, s1);
    const V w1 = hn::Mul(share, hn::Add(hn::NegMulAdd(two, s0, hn::Sub(one, f)), s1));
    const V w2 = hn::Mul(share, hn::Add(hn::NegMulAdd(two, s1, f), s0));
    // Without weight, the first column is left out.
    const auto skip = hn::Eq(w0, zero);
    hn::Store(hn::IfThenElse(skip, w1, w0), kF, weight[0] + i);
    hn::Store(hn::IfThenElse(skip, w2, w1), kF, weight[1] + i);
    hn::Store(hn::IfThenElse(skip, w3, w2), kF, weight[2] + i);
    hn::Store(hn::IfThenElse(skip, zero, w3), kF, weight[3] + i);
    hn::Store(hn::ConvertTo(kI, hn::IfThenElseZero(hn::Gt(share, zero), one)), kI, used + i);
    hn::Store(hn::ConvertTo(kI, hn::Add(hn::Sub(n, one), hn::IfThenElseZero(skip, one))), kI, column + i);
  }

  // Height y above voxel row 0 is seen by pixel axis_up + (y - height) / m.
  HWY_INLINE void find_borders(int i) {
    const V pixel = hn::LoadU(kF, patch.m + i), reach_px = hn::LoadU(kF, patch.half_px + i);
    const V px = hn::Div(set(1), pixel), reach = hn::Mul(pixel, reach_px);
    const V low = hn::MulAdd(set(-0.5 - shape.height), px, set(shape.axis_up));
    const V high = hn::MulAdd(set(shape.ny - 0.5 - shape.height), px, set(shape.axis_up));
    hn::Store(pixel, kF, m + i);
    hn::Store(px, kF, per_voxel + i);
    hn::Store(reach, kF, half + i);
    hn::Store(reach_px, kF, half_px + i);
    hn::Store(hn::Div(set(0.25), hn::Max(reach, set(1e-6))), kF, bump2 + i);
    hn::Store(low, kF, from + i);
    hn::Store(high, kF, to + i);
    hn::Store(hn::ConvertTo(kI, hn::Max(hn::Zero(kF), hn::Floor(hn::Sub(low, reach_px)))), kI, first + i);
    hn::Store(hn::ConvertTo(kI, hn::Min(set(shape.rows - 1), hn::Ceil(hn::Add(high, reach_px)))), kI,
              last + i);
    hn::Store(hn::ConvertTo(kI, hn::Ceil(hn::Add(low, reach_px))), kI, whole_first + i);
    // What lies beyond the last pixel is padding.
    const V whole = hn::Floor(hn::Sub(high, reach_px));
    hn::Store(hn::ConvertTo(kI, hn::IfThenElse(hn::Ge(whole, set(shape.rows - 1)), set(1e6), whole)), kI,
              whole_last + i);
  }

  // At the faces of the box the outermost voxels stand in for those beyond; what does not matter is left out.
  void fit(int lane, int begin, int end) {
    if (column[lane] >= begin && column[lane] + columns <= end) return;
    const int top = shape.others - 1, base = std::clamp(column[lane], begin, end - columns);
    float kept[4] = {};
    for (int j = 0; j < 4; ++j) {
      const int at = std::clamp(column[lane] + j, 0, top);
      if (weight[j][lane] != 0 && at >= begin && at < end) kept[at - base] += weight[j][lane];
    }
    for (int j = 0; j < 4; ++j) weight[j][lane] = kept[j];
    used[lane] = kept[0] != 0 || kept[1] != 0 || kept[2] != 0 || kept[3] != 0;
    column[lane] = base;
  }

  // First of the voxel columns of strip s among those alike.
  HWY_INLINE std::size_t columns_at(const Alike& alike, int s) const {
    return patch.plane + static_cast<std::size_t>(alike.plane + s) * patch.plane_step +
           static_cast<std::size_t>(column[alike.lane + s]) * shape.stride;
  }
  HWY_INLINE bool is_lit(const Alike& alike, int s, const std::uint8_t* lit) const {
    if (used[alike.lane + s] == 0) return false;
    const std::size_t at = columns_at(alike, s) / shape.column, step = shape.stride / shape.column;
    std::uint8_t any = 0;
    for (int j = 0; j < columns; ++j) any |= lit[at + static_cast<std::size_t>(j) * step];
    return any != 0;
  }
};

// What strips that are resampled as one share, its numbers at hand.
struct Strip {
  float m, per_voxel, half, half_px, bump2, from, to;
  int first, last, whole_first, whole_last;
  double height, axis_up;

  HWY_INLINE Strip(const Block& b, int lane)
      : m(b.m[lane]),
        per_voxel(b.per_voxel[lane]),
        half(b.half[lane]),
        half_px(b.half_px[lane]),
        bump2(b.bump2[lane]),
        from(b.from[lane]),
        to(b.to[lane]),
        first(b.first[lane]),
        last(b.last[lane]),
        whole_first(b.whole_first[lane]),
        whole_last(b.whole_last[lane]),
        height(b.shape.height),
        axis_up(b.shape.axis_up) {}

  // Height that pixel `up` looks at, voxels.
  HWY_INLINE double at(int up) const { return height + m * (up - axis_up); }
  HWY_INLINE bool whole(int up) const { return up >= whole_first && up + kLanes - 1 <= whole_last; }
  // Shares of pixels up, up + 1, ... that lie between the faces of the box.
  HWY_INLINE V share(int up) const {
    const V one = set(1), half_one = set(0.5), slope = set(half_px > 0 ? 0.5f / half_px : 1e9f);
    const V pixel = hn::Iota(kF, static_cast<float>(up));
    const V low = hn::Min(one, hn::MulAdd(hn::Sub(pixel, set(from)), slope, half_one));
    const V high = hn::Min(one, hn::MulAdd(hn::Sub(set(to), pixel), slope, half_one));
    return hn::Max(hn::Zero(kF), hn::Sub(hn::Add(low, high), one));
  }
};

}  // namespace HWY_NAMESPACE
}  // namespace flamefield
HWY_AFTER_NAMESPACE();

#endif
