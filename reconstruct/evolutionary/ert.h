#pragma once

#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

// Evolutionary reconstruction of a scalar field ("3D Evolutionary Reconstruction of Scalar Fields in the
// Gas-Phase", Energies 12, 2019; the paper): a genetic algorithm whose chromosomes are fields. Names as
// there.
struct ErtOptions {
  // Paper: Algorithms 1 and 2 as written. Brood: see brood.h; rates are shares of the offspring to begin
  // with.
  enum class Scheme { Brood, Paper };
  Scheme scheme = Scheme::Brood;

  int pop_size = 512;
  int max_generations = 10000000;
  double fit_threshold = 1;  // ends when 1 - Z reaches it
  double lp = 2;             // p of Eq. 2

  double mutation_rate = 0.05;
  int mutation_intensity = 1;  // voxels
  double sigma = 0.1;          // of the mutation, share of the largest voxel value
  double annihilation_rate = 0.02;
  int annihilation_intensity = 1;
  double filter_rate = 0.05;
  int filter_intensity = 1;
  bool weak_elitism = true;    // the best is always one parent, the other is random
  bool strong_elitism = true;  // the best survives unaltered
  int mask_samples = 300000;
  int ma_start = 2000;  // generation from which the mask follows the best chromosome
  int steps = 1000;     // generations between new masks

  // Paper scheme only.
  double sigma_start = 0;  // sigma falls from here; 0: it stays as it is
  double sigma_generations = 60000;
  bool incremental = true;  // images follow from the parents'; false: every offspring is rendered

  // Brood scheme only.
  double creep_rate = 0.83;      // mutation around the voxel's own value
  double crossover_rate = 0.05;  // means of the best and another
  bool adaptive = true;          // rates and sigmas follow success
  int levels = 3;                // grids from coarse to fine, each of twice the resolution
  double coarse_effort = 60;     // offspring per voxel on coarse grids, at most
  double roughness = 0.003;      // weight of uneven fields against the misfit, without noise; grows with it
  double roughness_edge = 0.015;
  int migrate_every = 4;    // generations between exchanges of islands, one on each rank
  double tolerance = 1e-4;  // ends when 8 offspring per voxel improve less, share of the objective

  int render_every = 5000;  // generations between full renderings that remove rounding
  double columns_budget_mib = 2048;
  int ensemble = 1;          // independent runs, whose mean and deviation are returned
  int calibrate_rounds = 0;  // cameras are corrected between so many solves; 0: they are trusted
  double absorption = 0;     // self-absorption per emission and mm, 1 / (field unit mm)
};
std::vector<SettingField> ert_fields(ErtOptions& options);

// InvalidInput: a checkpoint that does not fit, or where there is none to be had.
Result<Solution> solve_ert(const Problem& problem, const ErtOptions& options);

}  // namespace flamefield
