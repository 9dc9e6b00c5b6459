#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// Evolutionary reconstruction of a scalar field ("3D Evolutionary Reconstruction of Scalar Fields in the
// Gas-Phase", Energies 12, 2019; the paper): a genetic algorithm whose chromosomes are fields. Names as
// there.
struct ErtOptions {
  int population_size = 4;
  int max_generations = 200000;
  double fit_threshold = 1;  // ends when 1 - Z reaches it
  double lp = 1;             // p of Eq. 2

  double mutation_rate = 0.8;
  int mutation_intensity = 3;  // voxels
  double sigma = 0.03;  // of the mutation, share of the largest voxel value; falls to it from sigma_start
  double sigma_start = 0.25;
  double sigma_generations = 60000;  // e-folding of the fall
  double annihilation_rate = 0.3;
  int annihilation_intensity = 1;
  double filter_rate = 0.6;
  int filter_intensity = 4;

  bool weak_elitism = true;    // the best is always one parent, the other is random
  bool strong_elitism = true;  // the best survives unaltered

  int mask_samples = 300000;
  int ma_start = 5000;  // generation from which the mask follows the best chromosome
  int steps = 1000;     // generations between new masks

  int render_every = 5000;  // generations between full renderings that remove rounding
  double columns_budget_mib = 2048;
  bool incremental = true;  // images follow from the parents'; false: every offspring is rendered
};
std::vector<SettingField> ert_fields(ErtOptions& options);

Solution solve_ert(const Problem& problem, const ErtOptions& options);

}  // namespace flamefield
