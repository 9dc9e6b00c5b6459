#pragma once

#include <vector>

#include "reconstruct/algebraic/quadratic.h"

namespace flamefield {

// Tikhonov regularisation (Soviet Math. Dokl. 4, 1963) of order 0 or 1 with constraints: every pixel counts
// alike. The weight is chosen so that the misfit is what the noise explains, unless the recipe says
// otherwise.
struct TikhonovOptions {
  QuadraticOptions quadratic;
};
std::vector<SettingField> tikhonov_fields(TikhonovOptions& options);

Solution solve_tikhonov(const Problem& problem, const TikhonovOptions& options);

}  // namespace flamefield
