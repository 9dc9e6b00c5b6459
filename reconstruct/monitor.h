#pragma once

#include <array>
#include <chrono>
#include <optional>
#include <vector>

#include "reconstruct/settings.h"
#include "reconstruct/solver.h"

namespace flamefield {

// When an iterative solver ends before its last iteration (recipe table [stop]); 0 switches a rule off.
struct StopRules {
  double residual = 0;           // when |Ax - b| / |b| is at or below
  double discrepancy = 0;        // when |Ax - b| is at or below so many times the noise (Morozov 1966)
  double stagnation = 0;         // when |Ax - b| fell by a smaller share over 10 iterations
  double expected_residual = 0;  // |noise| / |b|, for the discrepancy; no setting
};
std::vector<SettingField> fields_of(StopRules& rules);

// Watches a solve: clock, stop token, history and progress. A solver calls after() at every iteration and
// ends when it gets a reason.
class Monitor {
 public:
  Monitor(const SolveControl& control, int max_iterations, const StopRules& rules = {});

  // residual: |Ax - b| / |b|; fitness: 1 - Z of evolutionary solvers
  std::optional<StopReason> after(int iteration, double residual, double fitness = 0,
                                  const std::array<float, 5>& operator_success = {});

  // Only the outside reasons to end, for solvers that report less often than they iterate. Of several ranks,
  // all ask, and the first one decides.
  std::optional<StopReason> interrupted() const;

  double elapsed_s() const;
  const std::vector<HistoryPoint>& history() const { return history_; }

 private:
  bool stagnates() const;

  const SolveControl& control_;
  int max_iterations_;
  StopRules rules_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::vector<HistoryPoint> history_;
};

}  // namespace flamefield
