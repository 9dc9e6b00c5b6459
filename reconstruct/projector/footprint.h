#pragma once

#include <algorithm>
#include <cmath>

namespace flamefield {

// What a pixel of finite width sees of trilinear voxels, along one axis of the volume. A voxel is a hat
// function (width 2); a pixel averages over a box of half width h around x. With the ramp averaged over the
// box,
//   ramp_h(x) = x for x >= h, 0 for x <= -h, (x + h)^2 / 4h between,
// the average of the hat is its second difference, since hat(x) = ramp(x+1) - 2 ramp(x) + ramp(x-1).
// Splitting off the bump, ramp_h(x) = max(x, 0) + bump_h(x), leaves linear interpolation plus the bump
// applied to second differences of the field, which is how the fast kernels compute it. h = 0 is the central
// ray.
inline double bump(double x, double h) {
  const double inside = std::max(0.0, h - std::abs(x));
  return h > 0 ? inside * inside / (4 * h) : 0;
}

// Average over [x - h, x + h] of the hat function at 0.
inline double averaged_hat(double x, double h) {
  return std::max(0.0, 1 - std::abs(x)) + bump(x + 1, h) - 2 * bump(x, h) + bump(x - 1, h);
}

// Share of the box [x - h, x + h] that lies inside [low, high]; for h = 0 whether x does.
inline double coverage(double x, double h, double low, double high) {
  if (h > 0) return std::clamp((std::min(x + h, high) - std::max(x - h, low)) / (2 * h), 0.0, 1.0);
  return x >= low && x <= high ? 1 : 0;
}

// Weights of the voxels of one axis (0 .. size - 1) in a pixel's average at x. Beyond the outermost centres
// the field continues flat to the faces of the box, at -1/2 and size - 1/2, and is zero outside.
constexpr double kLargestHalfWidth = 2;
constexpr int kMostWeights = 6;
struct Footprint {
  int first = 0, count = 0;
  float weight[kMostWeights] = {};
};

inline Footprint footprint(double x, double h, int size) {
  Footprint out;
  const double covered = coverage(x, h, -0.5, size - 0.5);
  if (covered <= 0) return out;
  const int reach = h > 1 ? 2 : h > 0 ? 1 : 0, n = static_cast<int>(std::floor(x));
  const auto inside = [size](int i) { return std::clamp(i, 0, size - 1); };
  out.first = inside(n - reach);
  out.count = inside(n + 1 + reach) - out.first + 1;
  for (int i = n - reach; i <= n + 1 + reach; ++i) {
    out.weight[inside(i) - out.first] += static_cast<float>(covered * averaged_hat(x - i, h));
  }
  while (out.count > 0 && out.weight[out.count - 1] == 0) --out.count;
  int skip = 0;
  while (skip < out.count && out.weight[skip] == 0) ++skip;
  for (int i = skip; skip > 0 && i < kMostWeights; ++i) {
    out.weight[i - skip] = out.weight[i];
    out.weight[i] = 0;
  }
  out.first += skip;
  out.count -= skip;
  return out;
}

}  // namespace flamefield
