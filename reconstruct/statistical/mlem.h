#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// Maximum-likelihood expectation maximisation for Poisson data (Shepp and Vardi, IEEE Trans. Med. Imaging
// MI-1, 1982), with ordered subsets of views (Hudson and Larkin, IEEE Trans. Med. Imaging 13, 1994) and
// smoothing between iterations (Silverman et al., J. R. Stat. Soc. B 52, 1990):
//   x <- S( x / (A_s^T 1) * A_s^T (b_s / (A_s x)) )
struct MlemOptions {
  int max_iterations = 80;
  int subsets = 1;         // of views; 1: MLEM, more: OSEM
  double smoothing = 0.1;  // share of the paper's filter (1/2 centre + 1/12 neighbours) after each iteration
};
std::vector<SettingField> mlem_fields(MlemOptions& options);
std::vector<SettingField> osem_fields(MlemOptions& options);

Solution solve_mlem(const Problem& problem, const MlemOptions& options);

}  // namespace flamefield
