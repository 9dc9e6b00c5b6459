// Compiled once for every instruction set; the best one the machine has is chosen when it runs.
#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "reconstruct/projector/column_kernels.cc"
#include <hwy/foreach_target.h>
//
#include <hwy/highway.h>

#include "reconstruct/projector/column_kernels.h"
#include "reconstruct/projector/strip_block-inl.h"

HWY_BEFORE_NAMESPACE();
namespace flamefield {
namespace HWY_NAMESPACE {

// out = weighted sum of kColumns voxel columns of each of kStrips strips.
template <int kColumns, int kStrips>
HWY_INLINE void blend_some(const float* HWY_RESTRICT volume, const Block& block, const Alike& alike,
                           float* HWY_RESTRICT out) {
  V weight[kStrips][kColumns];
  const float* from[kStrips];
  for (int s = 0; s < kStrips; ++s) {
    from[s] = volume + block.columns_at(alike, s);
    for (int j = 0; j < kColumns; ++j) weight[s][j] = hn::Set(kF, block.weight[j][alike.lane + s]);
  }
  const std::size_t stride = block.shape.stride;
  for (std::size_t y = 0; y < block.shape.column; y += kLanes) {
    V sum[kStrips];  // apart, for shorter chains
    for (int s = 0; s < kStrips; ++s) {
      sum[s] = hn::Mul(weight[s][0], hn::LoadU(kF, from[s] + y));
      for (int j = 1; j < kColumns; ++j) {
        sum[s] = hn::MulAdd(weight[s][j], hn::LoadU(kF, from[s] + static_cast<std::size_t>(j) * stride + y),
                            sum[s]);
      }
    }
    hn::Store(kStrips == 1 ? sum[0] : hn::Add(sum[0], sum[kStrips - 1]), kF, out + y);
  }
}

template <int kStrips>
HWY_INLINE void blend(const float* volume, const Block& block, const Alike& alike, float* out) {
  switch (block.columns) {
    case 2:
      return blend_some<2, kStrips>(volume, block, alike, out);
    case 3:
      return blend_some<3, kStrips>(volume, block, alike, out);
    default:
      return blend_some<4, kStrips>(volume, block, alike, out);
  }
}

// Pixels on a vector's last lane look up to (lanes - 1) m + 1 beyond its base, and the taps reach two
// further.
HWY_INLINE bool has_room(float m) {
  return static_cast<float>(kLanes - 1) * m + 4 <= 2 * kLanes - 1;
}

// How far pixels average: not at all, over at most half a voxel to each side, over at most one.
enum class Reach { Point, Half, One };

// Values of c, from a base, at `at` (footprint.h).
template <Reach kReach, bool kRoom>
HWY_INLINE V averaged(const float* HWY_RESTRICT c, V at, V h, V scale) {
  const V zero = hn::Zero(kF);
  if constexpr (kReach == Reach::Point) {
    const VI index = truncate(at);
    V tap[2];
    look_up<2, kRoom>(c, index, tap);
    return hn::MulAdd(hn::Sub(at, hn::ConvertTo(kF, index)), hn::Sub(tap[1], tap[0]), tap[0]);
  } else if constexpr (kReach == Reach::Half) {  // only the nearest voxel's second difference counts
    const VI index = truncate(hn::Add(at, set(0.5)));
    const V away = hn::Sub(at, hn::ConvertTo(kF, index)), inside = hn::Max(zero, hn::Sub(h, hn::Abs(away)));
    V tap[3];
    look_up<3, kRoom>(c - 1, index, tap);
    const V square = hn::Mul(inside, inside), up = hn::Max(zero, away), down = hn::Sub(up, away);
    const V sum = hn::MulAdd(hn::MulAdd(scale, square, up), hn::Sub(tap[2], tap[1]), tap[1]);
    return hn::MulAdd(hn::MulAdd(scale, square, down), hn::Sub(tap[0], tap[1]), sum);
  } else {
    const VI index = truncate(at);
    const V f = hn::Sub(at, hn::ConvertTo(kF, index));
    V tap[4];
    look_up<4, kRoom>(c - 1, index, tap);
    const V u = hn::Max(zero, hn::Sub(h, f)), v = hn::Max(zero, hn::Add(hn::Sub(h, set(1)), f)),
            two = set(-2);
    const V bend0 = hn::Add(hn::MulAdd(two, tap[1], tap[0]), tap[2]);
    const V bend1 = hn::Add(hn::MulAdd(two, tap[2], tap[1]), tap[3]);
    const V bump = hn::MulAdd(hn::Mul(v, v), bend1, hn::Mul(hn::Mul(u, u), bend0));
    return hn::MulAdd(scale, bump, hn::MulAdd(f, hn::Sub(tap[2], tap[1]), tap[1]));
  }
}

// Resamples the blended column c, which continues flat at both ends, onto the line.
template <Reach kReach, bool kRoom>
HWY_INLINE void add_line(const Strip& strip, const float* HWY_RESTRICT c, float* HWY_RESTRICT line) {
  const V slope = hn::Mul(hn::Set(kF, strip.m), hn::Iota(kF, 0)), zero = hn::Zero(kF);
  const V h = set(strip.half), scale = hn::Set(kF, strip.bump2);
  for (int up = strip.first / kLanes * kLanes; up <= strip.last; up += kLanes) {
    const double b = strip.at(up), base = std::floor(b);
    V sum = averaged<kReach, kRoom>(c + static_cast<int>(base), hn::Add(slope, set(b - base)), h, scale);
    if (!strip.whole(up)) {
      // What lies beyond the box is whatever the buffer held, perhaps not even a number.
      const V share = strip.share(up);
      sum = hn::IfThenElseZero(hn::Gt(share, zero), hn::Mul(sum, share));
    }
    hn::StoreU(hn::Add(hn::LoadU(kF, line + up), sum), kF, line + up);
  }
}

template <Reach kReach>
HWY_INLINE void add_line(const Strip& strip, const float* HWY_RESTRICT c, float* HWY_RESTRICT line) {
  if (has_room(strip.m))
    add_line<kReach, true>(strip, c, line);
  else
    add_line<kReach, false>(strip, c, line);
}

template <class Work>
HWY_INLINE void each_alike(const StripPatch& patch, const Work& work) {
  for (int col = 0, lane = 0; col < patch.cols; ++col)
    for (int plane = 0; plane < patch.planes; plane += patch.alike) {
      const int count = std::min(patch.alike, patch.planes - plane);
      work(Alike{lane, count, col, plane});
      lane += count;
    }
}

HWY_INLINE void resample(const Block& block, const Alike& alike, float* HWY_RESTRICT c,
                         float* HWY_RESTRICT images) {
  const int ny = block.shape.ny;
  c[-1] = c[-2] = c[-3] = c[0];
  c[ny] = c[ny + 1] = c[ny + 2] = c[ny - 1];
  const Strip strip(block, alike.lane);
  float* line = images + block.patch.line + static_cast<std::size_t>(alike.col) * block.patch.line_step;
  if (strip.half > 0.5f)
    add_line<Reach::One>(strip, c, line);
  else if (strip.half > 0)
    add_line<Reach::Half>(strip, c, line);
  else
    add_line<Reach::Point>(strip, c, line);
}

// One step behind: what has just been stored in vectors is slow to load at other borders.
void AddForward(const float* volume, const std::uint8_t* lit, const StripPatch& patch,
                const StripShape& shape, KernelScratch& scratch, float* images) {
  const Block block(patch, shape, shape.begin, shape.end);
  Alike before;
  std::size_t buffer = 0;
  each_alike(patch, [&](const Alike& alike) HWY_ATTR {
    if (block.first[alike.lane] > block.last[alike.lane]) return;
    bool any = false;
    for (int s = 0; s < alike.count; ++s) any = any || block.is_lit(alike, s, lit);
    if (!any) return;
    if (alike.count == 1)
      blend<1>(volume, block, alike, scratch.buffer(buffer));
    else
      blend<2>(volume, block, alike, scratch.buffer(buffer));
    buffer = 1 - buffer;
    if (before.count > 0) resample(block, before, scratch.buffer(buffer), images);
    before = alike;
  });
  if (before.count > 0) resample(block, before, scratch.buffer(1 - buffer), images);
}

// The part of a line that the strip sees, into a buffer that is zero beyond the line.
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
  const V h = set(strip.half), bump = hn::Set(kF, strip.bump2), zero = hn::Zero(kF);
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
          const V s = hn::Max(zero, hn::Sub(h, away));
          bent = hn::MulAdd(hn::Mul(s, s), tap[t], bent);
        }
        x = hn::Add(x, m);
      }
    }
    hn::Store(sum, kF, direct + y);
    if constexpr (kArea) hn::Store(hn::Mul(bump, bent), kF, bend + y);
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

// Adds the gathered column, times their weights, to kColumns voxel columns of each of kStrips strips.
template <int kColumns, int kStrips, bool kArea>
HWY_INLINE void spread_some(const float* HWY_RESTRICT direct, const float* HWY_RESTRICT bend,
                            const Block& block, const Alike& alike, float* HWY_RESTRICT volume) {
  V weight[kStrips][kColumns];
  float* to[kStrips];
  for (int s = 0; s < kStrips; ++s) {
    to[s] = volume + block.columns_at(alike, s);
    for (int j = 0; j < kColumns; ++j) weight[s][j] = hn::Set(kF, block.weight[j][alike.lane + s]);
  }
  const V minus_two = set(-2);
  const std::size_t stride = block.shape.stride;
  for (std::size_t y = 0; y < block.shape.column; y += kLanes) {
    V value = hn::LoadU(kF, direct + y);
    if constexpr (kArea) {
      const V sides = hn::Add(hn::LoadU(kF, bend + y - 1), hn::LoadU(kF, bend + y + 1));
      value = hn::Add(value, hn::MulAdd(minus_two, hn::LoadU(kF, bend + y), sides));
    }
    for (int s = 0; s < kStrips; ++s)
      for (int j = 0; j < kColumns; ++j) {
        float* at = to[s] + static_cast<std::size_t>(j) * stride + y;
        hn::StoreU(hn::MulAdd(weight[s][j], value, hn::LoadU(kF, at)), kF, at);
      }
  }
}

template <int kStrips, bool kArea>
HWY_INLINE void spread(const float* direct, const float* bend, const Block& block, const Alike& alike,
                       float* volume) {
  switch (block.columns) {
    case 2:
      return spread_some<2, kStrips, kArea>(direct, bend, block, alike, volume);
    case 3:
      return spread_some<3, kStrips, kArea>(direct, bend, block, alike, volume);
    default:
      return spread_some<4, kStrips, kArea>(direct, bend, block, alike, volume);
  }
}

// Fills the buffers `direct` and `bend` with what the strips' voxel columns get.
HWY_INLINE void gather(const float* images, const Block& block, const Alike& alike, float* pixels,
                       float* direct, float* bend) {
  const Strip strip(block, alike.lane);
  const StripShape& shape = block.shape;
  const float* line = images + block.patch.line + static_cast<std::size_t>(alike.col) * block.patch.line_step;
  copy_seen(line, strip, shape, pixels);
  if (strip.half > 0)
    gather<true>(pixels, strip, shape, direct, bend);
  else
    gather<false>(pixels, strip, shape, direct, bend);
  fold(shape.ny, direct, bend, strip.half > 0);
}

HWY_INLINE void spread(const float* direct, const float* bend, const Block& block, const Alike& alike,
                       float* volume) {
  const bool area = block.half[alike.lane] > 0;
  if (alike.count == 1) {
    if (area)
      spread<1, true>(direct, bend, block, alike, volume);
    else
      spread<1, false>(direct, bend, block, alike, volume);
  } else {
    if (area)
      spread<2, true>(direct, bend, block, alike, volume);
    else
      spread<2, false>(direct, bend, block, alike, volume);
  }
}

void AddAdjoint(const float* images, const StripPatch& patch, const StripShape& shape, KernelScratch& scratch,
                float* volume) {
  const Block block(patch, shape, shape.begin, shape.end);
  const auto direct = [&](std::size_t buffer) { return scratch.buffer(2 * buffer) + kBelow; };
  const auto bend = [&](std::size_t buffer) { return scratch.buffer(2 * buffer + 1) + kBelow; };
  Alike before;
  std::size_t buffer = 0;
  each_alike(patch, [&](const Alike& alike) HWY_ATTR {
    if (block.first[alike.lane] > block.last[alike.lane]) return;
    if (block.used[alike.lane] == 0 && (alike.count == 1 || block.used[alike.lane + 1] == 0)) return;
    gather(images, block, alike, scratch.zero_edged(), direct(buffer), bend(buffer));
    buffer = 1 - buffer;
    if (before.count > 0) spread(direct(buffer), bend(buffer), block, before, volume);
    before = alike;
  });
  if (before.count > 0) spread(direct(1 - buffer), bend(1 - buffer), block, before, volume);
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
  data_.assign(kBuffers * span_ + 32, 0.0f);
  const auto address = reinterpret_cast<std::uintptr_t>(data_.data() + kMargin);
  offset_ = kMargin + (64 - address % 64) % 64 / sizeof(float);
}

void add_forward(const float* volume, const std::uint8_t* lit, const StripPatch& patch,
                 const StripShape& shape, KernelScratch& scratch, float* images) {
  HWY_DYNAMIC_DISPATCH(AddForward)(volume, lit, patch, shape, scratch, images);
}

void add_adjoint(const float* images, const StripPatch& patch, const StripShape& shape,
                 KernelScratch& scratch, float* volume) {
  HWY_DYNAMIC_DISPATCH(AddAdjoint)(images, patch, shape, scratch, volume);
}

const char* vector_target() {
  return HWY_DYNAMIC_DISPATCH(Target)();
}

}  // namespace flamefield
#endif
