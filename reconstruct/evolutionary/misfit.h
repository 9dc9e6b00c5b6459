#pragma once

#include <array>
#include <cmath>
#include <span>

#include "reconstruct/evolutionary/strip_table.h"

namespace flamefield {

// Sums of |residual|^p (Eq. 2) over the pixels that a change of one voxel touches.
class Misfit {
 public:
  explicit Misfit(double p) : p_(p) {}

  double p() const { return p_; }

  // Change of the sum when the voxel with these strips changes by `change`. patch: what earlier changes of
  // the same offspring add to the images; null: nothing.
  double after(std::span<const Strip> strips, float change, const float* residual, const float* patch) const {
    if (p_ == 2) return sum(strips, change, residual, patch, [](float r) { return r * r; });
    if (p_ == 1) return sum(strips, change, residual, patch, [](float r) { return std::abs(r); });
    const auto power = static_cast<float>(p_);
    return sum(strips, change, residual, patch, [power](float r) { return std::pow(std::abs(r), power); });
  }

  double total(std::span<const float> residual) const;

 private:
  // Four running sums, so that the strip can be worked on as one vector.
  template <class Power>
  static double sum(std::span<const Strip> strips, float change, const float* residual, const float* patch,
                    const Power& power) {
    std::array<float, Strip::kPixels> lanes = {};
    for (const Strip& strip : strips) {
      const float* r = residual + strip.first;
      for (std::size_t k = 0; k < Strip::kPixels; ++k) {
        const float now = patch ? r[k] - patch[strip.first + k] : r[k];
        lanes[k] += power(now - change * strip.weight[k]) - power(now);
      }
    }
    double total = 0;
    for (const float lane : lanes) total += static_cast<double>(lane);
    return total;
  }

  double p_;
};

}  // namespace flamefield
