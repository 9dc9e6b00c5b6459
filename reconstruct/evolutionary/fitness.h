#pragma once

#include <span>
#include <vector>

#include "reconstruct/random.h"

namespace flamefield {

// The paper's Z: for p = 1 the mean over all pixels and views of |reference - rendered| (Eq. 3); for other p
// of Eq. 2 the p-th root of the mean of |.|^p. Absolute fitness is 1 - Z. Bit-identical wherever it runs.
double distance_z(std::span<const float> reference, std::span<const float> rendered, double p);

// Eq. 4: 1 for the best, 0 for the worst; all 1 when all are equal.
std::vector<double> relative_fitness(std::span<const double> z);

// Roulette wheel: an index with probability f_i / sum f_k (Holland).
std::size_t roulette(std::span<const double> fitness, Stream& stream);

}  // namespace flamefield
