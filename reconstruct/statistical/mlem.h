#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"
#include "reconstruct/sweeps.h"

namespace flamefield {

// Maximum-likelihood expectation maximisation for Poisson data (Shepp and Vardi, IEEE Trans. Med. Imaging
// MI-1, 1982), with ordered subsets of views (OSEM; Hudson and Larkin, IEEE Trans. Med. Imaging 13, 1994) and
// smoothing between iterations (Silverman et al., J. R. Stat. Soc. B 52, 1990):
//   x <- S( x / (A_s^T 1) * A_s^T (b_s / (A_s x)) )
// Negative pixels count as dark; the field is never negative.
std::vector<SettingField> mlem_fields(SweepOptions& options);
std::vector<SettingField> osem_fields(SweepOptions& options);

Solution solve_mlem(const Problem& problem, const SweepOptions& options);

}  // namespace flamefield
