#include "reconstruct/random.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace flamefield {

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> c, std::array<std::uint32_t, 2> key) {
  for (int round = 0; round < 10; ++round) {
    const std::uint64_t p0 = std::uint64_t{0xD2511F53u} * c[0], p1 = std::uint64_t{0xCD9E8D57u} * c[2];
    c = {static_cast<std::uint32_t>(p1 >> 32) ^ c[1] ^ key[0], static_cast<std::uint32_t>(p1),
         static_cast<std::uint32_t>(p0 >> 32) ^ c[3] ^ key[1], static_cast<std::uint32_t>(p0)};
    key[0] += 0x9E3779B9u;
    key[1] += 0xBB67AE85u;
  }
  return c;
}

std::uint32_t Stream::bits() {
  if (used_ == 4) {
    const auto low = [](std::uint64_t v) { return static_cast<std::uint32_t>(v); };
    const auto high = [](std::uint64_t v) { return static_cast<std::uint32_t>(v >> 32); };
    block_ = philox({low(counter_), high(counter_), low(stream_), high(stream_)}, {low(seed_), high(seed_)});
    ++counter_;
    used_ = 0;
  }
  return block_[used_++];
}

double Stream::uniform() {
  return (bits() + 0.5) * 0x1p-32;
}

std::uint64_t Stream::below(std::uint64_t n) {
  return (std::uint64_t{bits()} * n) >> 32;
}

// Box and Muller (1958): two normals from two uniforms.
double Stream::normal() {
  if (has_spare_) {
    has_spare_ = false;
    return spare_normal_;
  }
  const double radius = std::sqrt(-2 * std::log(uniform())), angle = 2 * std::numbers::pi * uniform();
  spare_normal_ = radius * std::sin(angle);
  has_spare_ = true;
  return radius * std::cos(angle);
}

double Stream::poisson(double mean) {
  if (!(mean > 0)) return 0;
  if (mean > 1000) return std::max(0.0, std::round(mean + std::sqrt(mean) * normal()));
  // Arrivals with exponential waiting times until one unit of time is over; in pieces of 20, where the
  // product of uniforms is far from underflow.
  double count = 0;
  for (double left = mean; left > 0; left -= 20) {
    const double limit = std::exp(-std::min(left, 20.0));
    for (double product = uniform(); product > limit; product *= uniform()) ++count;
  }
  return count;
}

double Stream::truncated_normal(double mean, double sigma) {
  if (!(sigma > 0)) return mean;
  // Rejection, from the side that is hit more often: at least 0.34 of the draws are good.
  if (sigma < 1) {
    for (;;) {
      const double value = mean + sigma * normal();
      if (value >= 0 && value <= 1) return value;
    }
  }
  for (;;) {
    const double value = uniform(), z = (value - mean) / sigma;
    if (uniform() < std::exp(-0.5 * z * z)) return value;
  }
}

}  // namespace flamefield
