#include "reconstruct/problem.h"

#include <algorithm>
#include <cmath>

#include "proto/check.h"

namespace flamefield {

void constrain(const Problem& problem, std::span<float> x) {
  const std::span<const std::uint8_t> support = problem.support;
  expect(support.empty() || support.size() == x.size(), "the support has the volume's layout");
  const float floor = problem.non_negative ? 0.0f : -INFINITY;
  constexpr std::size_t kGrain = 8192;
  problem.team.run_ranges(x.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t j = begin; j < end; ++j) x[j] = std::max(x[j], floor);
    if (support.empty()) return;
    for (std::size_t j = begin; j < end; ++j) x[j] = support[j] ? x[j] : 0.0f;
  });
}

std::vector<float> start_of(const Problem& problem) {
  std::vector<float> x(problem.projector.layout().voxels(), 0);
  if (problem.start.empty()) return x;
  expect(problem.start.size() == x.size(), "the start has the volume's layout");
  std::ranges::copy(problem.start, x.begin());
  constrain(problem, x);
  return x;
}

NoiseModel noise_of(const Problem& problem) {
  if (problem.noise.is_known()) return problem.noise;
  return estimate_noise(problem.images, problem.projector.layout());
}

double relative_distance(std::span<const float> a, std::span<const float> b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = static_cast<double>(a[i]) - b[i];
    difference += d * d;
    size += static_cast<double>(b[i]) * b[i];
  }
  return size > 0 ? std::sqrt(difference / size) : difference > 0 ? INFINITY : 0;
}

}  // namespace flamefield
