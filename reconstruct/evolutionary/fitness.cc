#include "reconstruct/evolutionary/fitness.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace flamefield {

namespace {

// Eight running sums a chunk, so that the loop can be vectorised without reordering; chunks in double.
template <class Term>
double sum_of(std::span<const float> a, std::span<const float> b, const Term& term) {
  constexpr std::size_t kLanes = 8, kChunk = 512;
  double sum = 0;
  std::size_t i = 0;
  while (i + kLanes <= a.size()) {
    std::array<float, kLanes> lanes = {};
    const std::size_t end = std::min(a.size() / kLanes * kLanes, i + kChunk);
    for (; i < end; i += kLanes)
      for (std::size_t k = 0; k < kLanes; ++k) lanes[k] += term(a[i + k] - b[i + k]);
    for (const float lane : lanes) sum += lane;
  }
  for (; i < a.size(); ++i) sum += term(a[i] - b[i]);
  return sum;
}

}  // namespace

double distance_z(std::span<const float> reference, std::span<const float> rendered, double p) {
  const auto n = static_cast<double>(reference.size());
  if (p == 1) return sum_of(reference, rendered, [](float d) { return std::abs(d); }) / n;
  if (p == 2) return std::sqrt(sum_of(reference, rendered, [](float d) { return d * d; }) / n);
  const auto power = static_cast<float>(p);
  return std::pow(sum_of(reference, rendered, [power](float d) { return std::pow(std::abs(d), power); }) / n,
                  1 / p);
}

std::vector<double> relative_fitness(std::span<const double> z) {
  const auto [low, high] = std::ranges::minmax(z);
  std::vector<double> out;
  for (const double value : z) out.push_back(high > low ? 1 - (value - low) / (high - low) : 1);
  return out;
}

std::size_t roulette(std::span<const double> fitness, Stream& stream) {
  double total = 0;
  for (const double f : fitness) total += f;
  double left = stream.uniform() * total;
  for (std::size_t i = 0; i < fitness.size(); ++i) {
    left -= fitness[i];
    if (left < 0) return i;
  }
  return fitness.size() - 1;
}

}  // namespace flamefield
