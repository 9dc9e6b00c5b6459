#include "reconstruct/monitor.h"

#include "reconstruct/share.h"

namespace flamefield {

std::vector<SettingField> fields_of(StopRules& o) {
  return {{"residual", "", 0, 1, "stop when |Ax - b| / |b| is at or below; 0: never", &o.residual},
          {"discrepancy", "", 0, 100, "stop when |Ax - b| is at or below so many times the noise; 0: never",
           &o.discrepancy},
          {"stagnation", "", 0, 1, "stop when |Ax - b| fell by a smaller share over 10 iterations; 0: never",
           &o.stagnation}};
}

Monitor::Monitor(const SolveControl& control, int max_iterations, const StopRules& rules)
    : control_(control), max_iterations_(max_iterations), rules_(rules) {}

double Monitor::elapsed_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

std::optional<StopReason> Monitor::interrupted() const {
  if (agree(control_.ranks, control_.stop.stop_requested())) return StopReason::Cancelled;
  if (control_.time_limit_s > 0 && agree(control_.ranks, elapsed_s() >= control_.time_limit_s))
    return StopReason::TimeLimit;
  return std::nullopt;
}

bool Monitor::stagnates() const {
  constexpr std::size_t kSpan = 10;
  if (!(rules_.stagnation > 0) || history_.size() <= kSpan) return false;
  return history_.back().residual > (1 - rules_.stagnation) * history_[history_.size() - 1 - kSpan].residual;
}

std::optional<StopReason> Monitor::after(int iteration, double residual, double fitness,
                                         const std::array<float, 5>& operator_success) {
  history_.push_back({iteration, residual, elapsed_s(), fitness, operator_success});
  if (control_.progress) control_.progress({iteration, max_iterations_, residual, history_.back().elapsed_s});
  if (residual <= rules_.residual) return StopReason::Residual;
  if (residual <= rules_.discrepancy * rules_.expected_residual) return StopReason::Discrepancy;
  if (stagnates()) return StopReason::Stagnation;
  if (iteration >= max_iterations_) return StopReason::Iterations;
  return interrupted();
}

}  // namespace flamefield
