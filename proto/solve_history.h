#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace flamefield {

// How far a solve was at one moment.
struct HistoryPoint {
  int iteration = 0;
  double residual = 0;  // |Ax - b| / |b|
  double elapsed_s = 0;
  // Evolutionary solvers only: 1 - Z (paper), and the share of offspring since the last point that were
  // better than the best, by operator: creep, mutation, annihilation, filter, crossover.
  double fitness = 0;
  std::array<float, 5> operator_success = {};
};

// At most `most` points (two or more) of a history, evenly by place, the first and the last among them.
inline std::vector<HistoryPoint> thinned(const std::vector<HistoryPoint>& history, std::size_t most) {
  if (history.size() <= most) return history;
  std::vector<HistoryPoint> out;
  for (std::size_t i = 0; i < most; ++i) out.push_back(history[i * (history.size() - 1) / (most - 1)]);
  return out;
}

}  // namespace flamefield
