#pragma once

#include <vector>

#include "reconstruct/problem.h"

namespace flamefield {

// Options of the regularised solvers: see PrimalDual for what they minimise and what the weights count in.
struct VariationalOptions {
  enum class Prior { Hessian, Variation };
  Prior prior = Prior::Hessian;
  int max_iterations = 80;
  int search_iterations = 60;  // of these, spent while the weight is still moving
  double weight = 0;           // of the prior; 0: from the images, see WeightSearch
  double variation_share = 0;  // Hessian only: weight of the gradient's norm, share of `weight`
  double sparsity = 0;         // weight of the field itself
  double gap_tolerance = 1e-4;
};
std::vector<SettingField> hessian_fields(VariationalOptions& options);
std::vector<SettingField> tv_fields(VariationalOptions& options);

Solution solve_variational(const Problem& problem, const VariationalOptions& options);

}  // namespace flamefield
