#include "reconstruct/algebraic/tikhonov.h"

namespace flamefield {

std::vector<SettingField> tikhonov_fields(TikhonovOptions& o) {
  return fields_of(o.quadratic);
}

Solution solve_tikhonov(const Problem& problem, const TikhonovOptions& options) {
  Monitor monitor(problem.control, options.quadratic.max_iterations, problem.stop);
  return solve_quadratic(problem, options.quadratic, {}, monitor).solution;
}

}  // namespace flamefield
