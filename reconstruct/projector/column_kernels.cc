// Compiled once for every instruction set; the best one the machine has is chosen when it runs.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reconstruct/projector/column_kernels.cc"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

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
constexpr int kBlock = 16;  // strips whose weights are worked out together

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

// Weights and borders of up to kBlock strips.
struct Block {
  HWY_ALIGN float weight[4][kBlock];     // of `count` neighbouring voxel columns
  HWY_ALIGN std::int32_t count[kBlock];  // 0: nothing is seen
  HWY_ALIGN std::int32_t column[kBlock];
  HWY_ALIGN float m[kBlock], per_voxel[kBlock];                    // height of a pixel, voxels; 1 / m
  HWY_ALIGN float half[kBlock], half_px[kBlock];                   // that it averages over, voxels and px
  HWY_ALIGN float bump[kBlock];                                    // sqrt(1 / 4 half)
  HWY_ALIGN float from[kBlock], to[kBlock];                        // lower and upper face of the box, px
  HWY_ALIGN std::int32_t first[kBlock], last[kBlock];              // pixels that see something
  HWY_ALIGN std::int32_t whole_first[kBlock], whole_last[kBlock];  // pixels that see nothing but the box
  const StripRow& row;
  const StripShape& shape;
  int begin;

  HWY_INLINE Block(const StripRow& strips, const StripShape& strip_shape, int first_strip)
      : row(strips), shape(strip_shape), begin(first_strip) {
    for (int i = 0; i < kBlock; i += kLanes) {
      weigh_columns(i);
      find_borders(i);
    }
    for (int i = begin; i < std::min(row.count, begin + kBlock); ++i) {
      const int lane = i - begin;
      if (column[lane] < 0 || column[lane] + count[lane] > shape.others) merge_beyond(lane);
    }
  }

  // footprint.h: linear interpolation, and the bump on second differences; columns n - 1 .. n + 2, n =
  // floor(q).
  HWY_INLINE void weigh_columns(int i) {
    const V zero = hn::Zero(kF), one = set(1), two = set(2), quarter = set(0.25), tiny = set(1e-6);
    const V q = hn::LoadU(kF, row.q + begin + i), h = hn::LoadU(kF, row.half + begin + i);
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
    // Without weight, the first and the last column are left out.
    const auto skip = hn::Eq(w0, zero);
    hn::Store(hn::IfThenElse(skip, w1, w0), kF, weight[0] + i);
    hn::Store(hn::IfThenElse(skip, w2, w1), kF, weight[1] + i);
    hn::Store(hn::IfThenElse(skip, w3, w2), kF, weight[2] + i);
    hn::Store(w3, kF, weight[3] + i);
    const V skipped = hn::IfThenElseZero(skip, one), dropped = hn::IfThenElseZero(hn::Eq(w3, zero), one);
    const V used = hn::IfThenElseZero(hn::Gt(share, zero), hn::Sub(set(4), hn::Add(skipped, dropped)));
    hn::Store(hn::ConvertTo(kI, used), kI, count + i);
    hn::Store(hn::ConvertTo(kI, hn::Add(hn::Sub(n, one), skipped)), kI, column + i);
  }

  // Height y above voxel row 0 is seen by pixel axis_up + (y - height) / m.
  HWY_INLINE void find_borders(int i) {
    const V pixel = hn::LoadU(kF, row.m + begin + i), reach_px = hn::LoadU(kF, row.half_px + begin + i);
    const V px = hn::Div(set(1), pixel), reach = hn::Mul(pixel, reach_px);
    const V low = hn::MulAdd(set(-0.5 - shape.height), px, set(shape.axis_up));
    const V high = hn::MulAdd(set(shape.ny - 0.5 - shape.height), px, set(shape.axis_up));
    hn::Store(pixel, kF, m + i);
    hn::Store(px, kF, per_voxel + i);
    hn::Store(reach, kF, half + i);
    hn::Store(reach_px, kF, half_px + i);
    hn::Store(hn::Sqrt(hn::Div(set(0.25), hn::Max(reach, set(1e-6)))), kF, bump + i);
    hn::Store(low, kF, from + i);
    hn::Store(high, kF, to + i);
    hn::Store(hn::ConvertTo(kI, hn::Max(hn::Zero(kF), hn::Floor(hn::Sub(low, reach_px)))), kI, first + i);
    hn::Store(hn::ConvertTo(kI, hn::Min(set(shape.rows - 1), hn::Ceil(hn::Add(high, reach_px)))), kI,
              last + i);
    hn::Store(hn::ConvertTo(kI, hn::Ceil(hn::Add(low, reach_px))), kI, whole_first + i);
    hn::Store(hn::ConvertTo(kI, hn::Floor(hn::Sub(high, reach_px))), kI, whole_last + i);
  }

  // At the faces of the box the outermost voxels stand in for those beyond.
  void merge_beyond(int lane) {
    const int top = shape.others - 1, from_column = column[lane], columns = count[lane];
    const int low = std::clamp(from_column, 0, top), high = std::clamp(from_column + columns - 1, 0, top);
    float merged[4] = {};
    for (int j = 0; j < columns; ++j) merged[std::clamp(from_column + j, 0, top) - low] += weight[j][lane];
    for (int j = 0; j < 4; ++j) weight[j][lane] = merged[j];
    column[lane] = low;
    count[lane] = columns == 0 ? 0 : high - low + 1;
  }

  std::size_t columns_at(int lane) const {
    return row.plane + static_cast<std::size_t>(begin + lane) * row.plane_step +
           static_cast<std::size_t>(column[lane]) * shape.stride;
  }
  bool is_lit(int lane, const std::uint8_t* lit) const {
    const std::size_t from_column = columns_at(lane) / shape.column, step = shape.stride / shape.column;
    std::uint8_t any = 0;
    for (int j = 0; j < count[lane]; ++j) any |= lit[from_column + static_cast<std::size_t>(j) * step];
    return any != 0;
  }
  std::size_t line_at(int lane) const {
    return row.line + static_cast<std::size_t>(begin + lane) * row.line_step;
  }
};

// One strip of a block, its numbers at hand.
struct Strip {
  float m, per_voxel, half, half_px, bump, from, to;
  int first, last, whole_first, whole_last;
  double height, axis_up;

  HWY_INLINE Strip(const Block& b, int lane)
      : m(b.m[lane]),
        per_voxel(b.per_voxel[lane]),
        half(b.half[lane]),
        half_px(b.half_px[lane]),
        bump(b.bump[lane]),
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

template <int kCount>
HWY_INLINE void blend_some(const float* HWY_RESTRICT columns, const Block& block, int lane,
                           float* HWY_RESTRICT out) {
  V weight[kCount];
  const float* from[kCount];
  for (std::size_t j = 0; j < kCount; ++j) {
    weight[j] = hn::Set(kF, block.weight[j][lane]);
    from[j] = columns + j * block.shape.stride;
  }
  for (std::size_t y = 0; y < block.shape.column; y += kLanes) {
    V sum = hn::Mul(weight[0], hn::LoadU(kF, from[0] + y));
    for (int j = 1; j < kCount; ++j) sum = hn::MulAdd(weight[j], hn::LoadU(kF, from[j] + y), sum);
    hn::Store(sum, kF, out + y);
  }
}

HWY_INLINE void blend(const float* columns, const Block& block, int lane, float* out) {
  switch (block.count[lane]) {
    case 1:
      return blend_some<1>(columns, block, lane, out);
    case 2:
      return blend_some<2>(columns, block, lane, out);
    case 3:
      return blend_some<3>(columns, block, lane, out);
    default:
      return blend_some<4>(columns, block, lane, out);
  }
}

// Resamples the blended column c, which continues flat at both ends, onto the line.
template <bool kArea, bool kRoom>
HWY_INLINE void add_line(const Strip& strip, const float* HWY_RESTRICT c, float* HWY_RESTRICT line) {
  const V slope = hn::Mul(hn::Set(kF, strip.m), hn::Iota(kF, 0));
  const V h = set(strip.half), h1 = set(strip.half - 1), zero = hn::Zero(kF), minus_two = set(-2);
  const V scale = hn::Set(kF, strip.bump);
  for (int up = strip.first / kLanes * kLanes; up <= strip.last; up += kLanes) {
    const double b = strip.at(up);
    const double base = std::floor(b);
    const V at = hn::Add(slope, set(b - base));
    const VI index = truncate(at);
    const V f = hn::Sub(at, hn::ConvertTo(kF, index));
    V sum;
    if constexpr (kArea) {
      V tap[4];
      look_up<4, kRoom>(c + static_cast<int>(base) - 1, index, tap);
      const V u = hn::Mul(scale, hn::Max(zero, hn::Sub(h, f))),
              v = hn::Mul(scale, hn::Max(zero, hn::Add(h1, f)));
      const V bend0 = hn::Add(hn::MulAdd(minus_two, tap[1], tap[0]), tap[2]);
      const V bend1 = hn::Add(hn::MulAdd(minus_two, tap[2], tap[1]), tap[3]);
      sum = hn::MulAdd(f, hn::Sub(tap[2], tap[1]), tap[1]);
      sum = hn::MulAdd(hn::Mul(u, u), bend0, sum);
      sum = hn::MulAdd(hn::Mul(v, v), bend1, sum);
    } else {
      V tap[2];
      look_up<2, kRoom>(c + static_cast<int>(base), index, tap);
      sum = hn::MulAdd(f, hn::Sub(tap[1], tap[0]), tap[0]);
    }
    if (!strip.whole(
            up)) {  // what lies beyond the box is whatever the buffer held, perhaps not even a number
      const V share = strip.share(up);
      sum = hn::IfThenElseZero(hn::Gt(share, zero), hn::Mul(sum, share));
    }
    hn::StoreU(hn::Add(hn::LoadU(kF, line + up), sum), kF, line + up);
  }
}

// Pixels on a vector's last lane look up to (lanes - 1) m + 1 beyond its base, and the taps reach two
// further.
HWY_INLINE bool has_room(float m) {
  return static_cast<float>(kLanes - 1) * m + 4 <= 2 * kLanes - 1;
}

// work(block, lane) for every strip that sees something and is wanted(block, lane).
template <class Wanted, class Work>
HWY_INLINE void each_strip(const StripRow& row, const StripShape& shape, const Wanted& wanted,
                           const Work& work) {
  for (int begin = 0; begin < row.count; begin += kBlock) {
    const Block block(row, shape, begin);
    const int end = std::min(kBlock, row.count - begin);
    for (int lane = 0; lane < end; ++lane) {
      if (block.count[lane] > 0 && block.first[lane] <= block.last[lane] && wanted(block, lane))
        work(block, lane);
    }
  }
}

void AddForward(const float* volume, const std::uint8_t* lit, const StripRow& row, const StripShape& shape,
                KernelScratch& scratch, float* images) {
  const auto wanted = [&](const Block& block, int lane) { return block.is_lit(lane, lit); };
  each_strip(row, shape, wanted, [&](const Block& block, int lane) HWY_ATTR {
    float* c = scratch.first();
    blend(volume + block.columns_at(lane), block, lane, c);
    c[-1] = c[-2] = c[-3] = c[0];
    c[shape.ny] = c[shape.ny + 1] = c[shape.ny + 2] = c[shape.ny - 1];
    const Strip strip(block, lane);
    float* line = images + block.line_at(lane);
    const bool room = has_room(strip.m);
    if (strip.half > 0) {
      if (room)
        add_line<true, true>(strip, c, line);
      else
        add_line<true, false>(strip, c, line);
    } else {
      if (room)
        add_line<false, true>(strip, c, line);
      else
        add_line<false, false>(strip, c, line);
    }
  });
}

// The part of a line that the strip sees, into a buffer that is zero elsewhere.
HWY_INLINE void copy_seen(const float* HWY_RESTRICT line, const Strip& strip, const StripShape& shape,
                          float* HWY_RESTRICT out) {
  const int end = static_cast<int>(shape.line);
  for (int up = 0; up < end; up += kLanes) {
    V value = hn::Zero(kF);
    if (up <= strip.last && up + kLanes > strip.first) {
      value = hn::LoadU(kF, line + up);
      if (!strip.whole(up)) value = hn::Mul(value, strip.share(up));
    }
    hn::Store(value, kF, out + up);
  }
}

constexpr int kBelow = 2;  // the adjoint's buffers start so many voxels below the bottom of the box

// Gathers into each height what the pixels that see it hold: `direct` by linear interpolation transposed,
// `bend` by the bump transposed (only for kArea).
template <bool kArea, int kTaps, bool kRoom>
HWY_INLINE void gather(const float* HWY_RESTRICT pixels, const Strip& strip, const StripShape& shape,
                       float* HWY_RESTRICT direct, float* HWY_RESTRICT bend) {
  const double per_voxel = strip.per_voxel;
  const V slope = hn::Mul(set(per_voxel), hn::Iota(kF, 0)), m = hn::Set(kF, strip.m), one = set(1);
  const V h = set(strip.half), bump = hn::Set(kF, strip.bump), zero = hn::Zero(kF);
  const double end = static_cast<double>(shape.line);
  for (int y = -kBelow; y < shape.ny + 2; y += kLanes) {
    const double first = strip.axis_up + (y - 1 - strip.height) * per_voxel;  // looks one voxel below y
    V sum = zero, bent = zero;
    if (first > -2 * kLanes - 2 && first < end) {
      const double base = std::floor(first);
      const V at = hn::Add(slope, set(first - base)), next = hn::Ceil(at);
      V x = hn::MulSub(hn::Sub(next, at), m, one);  // where that pixel looks, from y
      V tap[kTaps];
      look_up<kTaps, kRoom>(pixels + static_cast<int>(base), truncate(next), tap);
      for (int t = 0; t < kTaps; ++t) {
        const V away = hn::Abs(x);
        sum = hn::MulAdd(hn::Max(zero, hn::Sub(one, away)), tap[t], sum);
        if constexpr (kArea) {
          const V s = hn::Mul(bump, hn::Max(zero, hn::Sub(h, away)));
          bent = hn::MulAdd(hn::Mul(s, s), tap[t], bent);
        }
        x = hn::Add(x, m);
      }
    }
    hn::Store(sum, kF, direct + y);
    if constexpr (kArea) hn::Store(bent, kF, bend + y);
  }
}

template <bool kArea>
HWY_INLINE void gather(const float* pixels, const Strip& strip, const StripShape& shape, float* direct,
                       float* bend) {
  const auto last_index = [&](int taps) {
    return static_cast<float>(kLanes - 1) / strip.m + 2 + static_cast<float>(taps);
  };
  if (strip.m >= 1) {
    if (last_index(2) <= 2 * kLanes) return gather<kArea, 2, true>(pixels, strip, shape, direct, bend);
    return gather<kArea, 2, false>(pixels, strip, shape, direct, bend);
  }
  if (3 * strip.m >= 2 && last_index(3) <= 2 * kLanes)
    return gather<kArea, 3, true>(pixels, strip, shape, direct, bend);
  return gather<kArea, 4, false>(pixels, strip, shape, direct, bend);
}

// Beyond the faces the field continues flat: what fell there belongs to the outermost voxels.
HWY_INLINE void fold(int ny, float* HWY_RESTRICT direct, float* HWY_RESTRICT bend, bool area) {
  direct[0] += direct[-1] + direct[-2];
  direct[ny - 1] += direct[ny] + direct[ny + 1];
  if (!area) return;
  direct[0] += bend[0];
  direct[ny - 1] += bend[ny - 1];
  bend[-1] = bend[ny] = 0;
}

template <int kCount, bool kArea>
HWY_INLINE void spread_some(const float* HWY_RESTRICT direct, const float* HWY_RESTRICT bend,
                            const Block& block, int lane, float* HWY_RESTRICT columns) {
  V weight[kCount];
  float* to[kCount];
  for (std::size_t j = 0; j < kCount; ++j) {
    weight[j] = hn::Set(kF, block.weight[j][lane]);
    to[j] = columns + j * block.shape.stride;
  }
  const V minus_two = set(-2);
  for (std::size_t y = 0; y < block.shape.column; y += kLanes) {
    V value = hn::LoadU(kF, direct + y);
    if constexpr (kArea) {
      const V sides = hn::Add(hn::LoadU(kF, bend + y - 1), hn::LoadU(kF, bend + y + 1));
      value = hn::Add(value, hn::MulAdd(minus_two, hn::LoadU(kF, bend + y), sides));
    }
    for (int j = 0; j < kCount; ++j) {
      hn::StoreU(hn::MulAdd(weight[j], value, hn::LoadU(kF, to[j] + y)), kF, to[j] + y);
    }
  }
}

template <bool kArea>
HWY_INLINE void spread(const float* direct, const float* bend, const Block& block, int lane, float* columns) {
  switch (block.count[lane]) {
    case 1:
      return spread_some<1, kArea>(direct, bend, block, lane, columns);
    case 2:
      return spread_some<2, kArea>(direct, bend, block, lane, columns);
    case 3:
      return spread_some<3, kArea>(direct, bend, block, lane, columns);
    default:
      return spread_some<4, kArea>(direct, bend, block, lane, columns);
  }
}

void AddAdjoint(const float* images, const StripRow& row, const StripShape& shape, KernelScratch& scratch,
                float* volume) {
  const auto all = [](const Block&, int) { return true; };
  each_strip(row, shape, all, [&](const Block& block, int lane) HWY_ATTR {
    float *direct = scratch.first() + kBelow, *bend = scratch.second() + kBelow, *pixels = scratch.third();
    const Strip strip(block, lane);
    float* columns = volume + block.columns_at(lane);
    copy_seen(images + block.line_at(lane), strip, shape, pixels);
    if (strip.half > 0) {
      gather<true>(pixels, strip, shape, direct, bend);
      fold(shape.ny, direct, bend, true);
      spread<true>(direct, bend, block, lane, columns);
    } else {
      gather<false>(pixels, strip, shape, direct, bend);
      fold(shape.ny, direct, bend, false);
      spread<false>(direct, bend, block, lane, columns);
    }
  });
}

const char* Target() {
  return hwy::TargetName(HWY_TARGET);
}

}  // namespace HWY_NAMESPACE
}  // namespace flamefield
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace flamefield {

HWY_EXPORT(AddForward);
HWY_EXPORT(AddAdjoint);
HWY_EXPORT(Target);

namespace {
constexpr std::size_t kMargin =
    80;  // floats: windows of two vectors start up to 36 before the data and end after
}

void KernelScratch::fit(const StripShape& shape) {
  const std::size_t span = (std::max(shape.column, shape.line) + 2 * kMargin + 15) / 16 * 16;
  if (span == span_ && shape.line == line_) return;
  span_ = span;
  line_ = shape.line;
  data_.assign(3 * span_ + 32, 0.0f);
  const auto address = reinterpret_cast<std::uintptr_t>(data_.data() + kMargin);
  offset_ = kMargin + (64 - address % 64) % 64 / sizeof(float);
}

void add_forward(const float* volume, const std::uint8_t* lit, const StripRow& row, const StripShape& shape,
                 KernelScratch& scratch, float* images) {
  HWY_DYNAMIC_DISPATCH(AddForward)(volume, lit, row, shape, scratch, images);
}

void add_adjoint(const float* images, const StripRow& row, const StripShape& shape, KernelScratch& scratch,
                 float* volume) {
  HWY_DYNAMIC_DISPATCH(AddAdjoint)(images, row, shape, scratch, volume);
}

const char* vector_target() {
  return HWY_DYNAMIC_DISPATCH(Target)();
}

}  // namespace flamefield
#endif
