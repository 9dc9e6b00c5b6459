#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// Conjugate gradients for min |A x - b|^2 + damping^2 |A|^2 |x|^2 (Hestenes and Stiefel, J. Res. Natl. Bur.
// Stand. 49, 1952), over the voxels of the support; the iterates are those of LSQR (Paige and Saunders, ACM
// Trans. Math. Softw. 8, 1982), and so are damping and tolerance. Few iterations regularise by themselves.
// Where negative values are not allowed they are cut off every few iterations, from where it starts anew
// (Calvetti, Landi, Reichel and Sgallari, Inverse Problems 20, 2004).
struct CglsOptions {
  int max_iterations = 40;
  int restart = 2;          // iterations between cuts of negative values
  double damping = 0;       // share of |A|
  double tolerance = 1e-6;  // ends when |A^T r| / (|A| |r|) is at or below, as LSQR's atol
};
std::vector<SettingField> cgls_fields(CglsOptions& options);

Solution solve_cgls(const Problem& problem, const CglsOptions& options);

}  // namespace flamefield
