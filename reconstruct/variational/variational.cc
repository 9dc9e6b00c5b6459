#include "reconstruct/variational/variational.h"

#include <cmath>

#include "proto/error.h"
#include "reconstruct/variational/weight_search.h"

namespace flamefield {

std::vector<SettingField> tv_fields(VariationalOptions& o) {
  return {{"max_iterations", "", 1, 1e6, "iterations at most", &o.max_iterations},
          {"search_iterations", "", 0, 1e6, "of these, how many look for the weight", &o.search_iterations},
          {"weight", "", 0, 1e3, "of the prior, share of the brightest pixel; 0: from the images", &o.weight},
          {"sparsity", "", 0, 1e3, "weight of the field itself, share of the brightest pixel", &o.sparsity},
          {"gap_tolerance", "", 0, 1, "stop when the duality gap is this share of the dark field's objective",
           &o.gap_tolerance}};
}

std::vector<SettingField> hessian_fields(VariationalOptions& o) {
  std::vector<SettingField> fields = tv_fields(o);
  fields.push_back({"variation_share", "", 0, 1e3, "total variation beside a given weight, share of it",
                    &o.variation_share});
  return fields;
}

namespace {

// Over-relaxed iterations, and every tenth a plain one, to look at where they are.
constexpr float kRelaxation = 1.8f;
constexpr int kLookEvery = 10, kFirstSearch = 20;

PriorWeights given_weights(const VariationalOptions& o) {
  if (o.prior == VariationalOptions::Prior::Variation) return {.variation = o.weight};
  return {.variation = o.variation_share * o.weight, .hessian = o.weight};
}

}  // namespace

Solution solve_variational(const Problem& problem, const VariationalOptions& options) {
  const bool searches = options.weight <= 0;
  PrimalDual state(problem);
  WeightSearch search(problem, options.prior == VariationalOptions::Prior::Variation
                                   ? WeightSearch::Kind::Variation
                                   : WeightSearch::Kind::Adaptive);
  const auto set_weights = [&](PriorWeights weights) {
    weights.sparsity = options.sparsity;
    state.set_weights(weights);
  };
  set_weights(searches ? search.weights() : given_weights(options));

  double norm = 0;
  for (const float b : problem.images) norm += static_cast<double>(b) * static_cast<double>(b);
  const double dark = norm / (2 * state.pixels_per_voxel());  // the objective of x = 0
  Monitor monitor(problem.control, options.max_iterations, problem.stop);
  Solution out;
  double gap = INFINITY;
  for (int iteration = 1;; ++iteration) {
    const bool looks = iteration % kLookEvery == 0 || iteration == options.max_iterations;
    state.iterate(looks ? 1 : kRelaxation);
    out.iterations = iteration;
    const bool searching = searches && iteration <= options.search_iterations;
    if (searching && iteration >= kFirstSearch && looks) {
      search.update(state);
      set_weights(search.weights());
    }
    const double residual = norm > 0 ? std::sqrt(state.residual_square() / norm) : 0;
    const auto reason = monitor.after(iteration, residual);
    if (reason && !looks) {
      state.iterate();  // so that the field keeps its constraints
      ++out.iterations;
    }
    if (!searching && (reason || looks)) gap = dark > 0 ? state.gap().gap() / dark : 0;
    if (reason || gap <= options.gap_tolerance) {
      out.stop_reason = reason.value_or(StopReason::Converged);
      break;
    }
  }
  const std::span<const float> x = state.field();
  out.volume.assign(x.begin(), x.end());
  out.voxel_updates = static_cast<double>(x.size()) * out.iterations;
  out.history = monitor.history();
  const PriorWeights& w = state.weights();
  out.notes.push_back(concat(searches ? "weights found: " : "weights given: ", "Hessian ", w.hessian,
                             ", total variation ", w.variation, ", sparsity ", w.sparsity));
  if (std::isfinite(gap)) out.notes.push_back(concat("duality gap ", gap, " of the dark field's objective"));
  return out;
}

}  // namespace flamefield
