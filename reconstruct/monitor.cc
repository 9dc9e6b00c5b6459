#include "reconstruct/monitor.h"

namespace flamefield {

Monitor::Monitor(const SolveControl& control, int max_iterations, double residual_tolerance)
    : control_(control), max_iterations_(max_iterations), residual_tolerance_(residual_tolerance) {}

double Monitor::elapsed_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

std::optional<StopReason> Monitor::interrupted() const {
  if (control_.stop.stop_requested()) return StopReason::Cancelled;
  if (control_.time_limit_s > 0 && elapsed_s() >= control_.time_limit_s) return StopReason::TimeLimit;
  return std::nullopt;
}

std::optional<StopReason> Monitor::after(int iteration, double residual, double fitness) {
  history_.push_back({iteration, residual, elapsed_s(), fitness});
  if (control_.progress) control_.progress({iteration, max_iterations_, residual, history_.back().elapsed_s});
  if (residual <= residual_tolerance_) return StopReason::Residual;
  if (iteration >= max_iterations_) return StopReason::Iterations;
  return interrupted();
}

}  // namespace flamefield
