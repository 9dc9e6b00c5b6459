#include "reconstruct/algebraic/cgls.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "reconstruct/algebraic/quadratic.h"
#include "reconstruct/vectors.h"

namespace flamefield {

std::vector<SettingField> cgls_fields(CglsOptions& o) {
  return {{"max_iterations", "", 1, 1e6, "iterations; more sharpen the noise", &o.max_iterations},
          {"restart", "", 1, 1e6, "iterations from one cut of negative values to the next", &o.restart},
          {"damping", "", 0, 1e3, "weight of |x|, share of |A|", &o.damping},
          {"tolerance", "", 0, 1, "stop when |A^T r| / (|A| |r|) is at or below", &o.tolerance}};
}

Solution solve_cgls(const Problem& problem, const CglsOptions& options) {
  const Projector& projector = problem.projector;
  Team& team = problem.team;
  Problem unsigned_problem = problem;
  unsigned_problem.non_negative = false;
  const double norm_a = std::sqrt(normal_scale(problem)), shift = std::pow(options.damping * norm_a, 2);
  const double norm_b = std::sqrt(squared_norm(team, problem.images));

  Monitor monitor(problem.control, options.max_iterations, problem.stop);
  Solution out;
  out.volume = start_of(unsigned_problem);
  std::vector<float> r(problem.images.begin(), problem.images.end()), q(r.size()), s(out.volume.size());
  const auto residual = [&] {  // r = b - A x
    std::ranges::copy(problem.images, r.begin());
    projector.forward(team, out.volume, q);
    add_scaled(team, -1, q, r);
  };
  const auto gradient = [&] {  // s = A^T r - shift x, on the support
    projector.adjoint(team, r, s);
    add_scaled(team, -shift, out.volume, s);
    constrain(unsigned_problem, s);
  };
  residual();
  gradient();
  std::vector<float> p = s;
  double gamma = squared_norm(projector, team, s);
  for (int iteration = 1;; ++iteration) {
    projector.forward(team, p, q);
    const double curvature = squared_norm(team, q) + shift * squared_norm(projector, team, p);
    if (curvature > 0) {
      const double step = gamma / curvature;
      add_scaled(team, step, p, out.volume);
      add_scaled(team, -step, q, r);
    }
    const bool cut = problem.non_negative && iteration % options.restart == 0;
    if (cut) {
      constrain(problem, out.volume);
      residual();
    }
    gradient();
    const double before = std::exchange(gamma, squared_norm(projector, team, s));
    out.iterations = iteration;
    out.voxel_updates += static_cast<double>(s.size());
    const double norm_r = std::sqrt(squared_norm(team, r));
    auto reason = monitor.after(iteration, norm_b > 0 ? norm_r / norm_b : 0);
    if (!reason && std::sqrt(gamma) <= options.tolerance * norm_a * norm_r) reason = StopReason::Converged;
    if (reason) {
      out.stop_reason = *reason;
      break;
    }
    const double ratio = before > 0 && !cut ? gamma / before : 0;
    team.run_ranges(p.size(), 8192, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = begin; j < end; ++j) p[j] = s[j] + static_cast<float>(ratio) * p[j];
    });
  }
  constrain(problem, out.volume);
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
