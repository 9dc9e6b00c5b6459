#pragma once

#include <chrono>
#include <optional>
#include <vector>

#include "reconstruct/solver.h"

namespace flamefield {

// Watches a solve: clock, stop token, history and progress. A solver calls after() at every iteration and
// ends when it gets a reason.
class Monitor {
 public:
  Monitor(const SolveControl& control, int max_iterations, double residual_tolerance);

  // residual: |Ax - b| / |b|; fitness: 1 - Z of evolutionary solvers
  std::optional<StopReason> after(int iteration, double residual, double fitness = 0);

  // Only the outside reasons to end, for solvers that report less often than they iterate.
  std::optional<StopReason> interrupted() const;

  double elapsed_s() const;
  const std::vector<HistoryPoint>& history() const { return history_; }

 private:
  const SolveControl& control_;
  int max_iterations_;
  double residual_tolerance_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::vector<HistoryPoint> history_;
};

}  // namespace flamefield
