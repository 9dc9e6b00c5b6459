#include "reconstruct/registry.h"

#include "proto/check.h"
#include "reconstruct/algebraic/art.h"
#include "reconstruct/algebraic/cgls.h"
#include "reconstruct/algebraic/mart.h"
#include "reconstruct/algebraic/sirt.h"
#include "reconstruct/algebraic/tikhonov.h"
#include "reconstruct/analytic/fdk.h"
#include "reconstruct/evolutionary/ert.h"
#include "reconstruct/evolutionary/memetic.h"
#include "reconstruct/statistical/map.h"
#include "reconstruct/statistical/mlem.h"
#include "reconstruct/variational/variational.h"

namespace flamefield {

namespace {

// A solver whose recipe table is named like it and holds the fields of Options.
template <class Options, class Answer>  // Answer: Solution or Result<Solution>
Solver entry(std::string_view name, std::string_view summary, Options defaults,
             std::vector<SettingField> (*fields)(Options&), Answer (*solve)(const Problem&, const Options&),
             Division division = Division::None, bool takes_start = true) {
  const auto read = [=](const Recipe& recipe, Options& options) {
    const std::vector<SettingField> bound = fields(options);
    return read_settings(name, bound, recipe);
  };
  return {name,
          summary,
          [=] {
            Options options = defaults;
            return describe(fields(options));
          },
          [=](const Recipe& recipe) {
            Options options = defaults;
            return read(recipe, options);
          },
          [=](const Problem& problem, const Recipe& recipe) -> Result<Solution> {
            Options options = defaults;
            expect(read(recipe, options).has_value(), "the recipe was checked");
            return solve(problem, options);
          },
          takes_start,
          division};
}

}  // namespace

std::span<const Solver> solvers() {
  static const std::vector<Solver> list = {
      entry("hessian", "non-negative least squares with a Hessian prior (Pock and Chambolle 2011)",
            VariationalOptions{}, hessian_fields, solve_variational, Division::Slabs),
      entry("tv", "non-negative least squares with total variation (Rudin, Osher and Fatemi 1992)",
            VariationalOptions{.prior = VariationalOptions::Prior::Variation}, tv_fields, solve_variational,
            Division::Slabs),
      entry("osem", "MLEM with ordered subsets of views (Hudson and Larkin 1994)",
            SweepOptions{.max_iterations = 12, .subsets = 5, .smoothing = 0.3}, osem_fields, solve_mlem,
            Division::Slabs),
      entry("mlem", "maximum likelihood for Poisson data (Shepp and Vardi 1982), smoothed EM",
            SweepOptions{.max_iterations = 80, .smoothing = 0.1}, mlem_fields, solve_mlem, Division::Slabs),
      entry("art", "algebraic reconstruction, one ray at a time (Kaczmarz 1937)", ArtOptions{}, art_fields,
            solve_art),
      entry("sart", "SIRT one view at a time (Andersen and Kak 1984)",
            SirtOptions{.sweeps = {.max_iterations = 10, .smoothing = 0.1}, .relaxation = 0.5}, sirt_fields,
            solve_sart, Division::Slabs),
      entry("os-sart", "SIRT with ordered subsets of views (Wang and Jiang 2004)",
            SirtOptions{.sweeps = {.max_iterations = 30, .subsets = 5, .smoothing = 0.1}, .relaxation = 1},
            os_sart_fields, solve_sirt, Division::Slabs),
      entry("sirt", "simultaneous iterative reconstruction (Gilbert 1972)", SirtOptions{}, sirt_fields,
            solve_sirt, Division::Slabs),
      entry("mart", "multiplicative ART by groups of views (Gordon, Bender and Herman 1970)", MartOptions{},
            mart_fields, solve_mart),
      entry("cgls", "conjugate gradients for least squares (Hestenes and Stiefel 1952)", CglsOptions{},
            cgls_fields, solve_cgls, Division::Slabs),
      entry("tikhonov", "least squares with a quadratic penalty (Tikhonov 1963)", TikhonovOptions{},
            tikhonov_fields, solve_tikhonov),
      entry("map", "most probable field under a Gaussian smoothness prior, with its noise sigma",
            MapOptions{}, map_fields, solve_map),
      entry("fdk", "filtered back-projection for a level ring of many cameras (Feldkamp et al. 1984)",
            FdkOptions{}, fdk_fields, solve_fdk, Division::None, false),
      entry("ert",
            "evolutionary reconstruction: genetic operators at Metropolis-drawn voxels (Energies 12, 2019)",
            ErtOptions{}, ert_fields, solve_ert, Division::Islands),
      entry("ert-memetic",
            "evolution with algebraic sweeps as one more genetic operator (Yang et al., hybrid)",
            MemeticOptions{}, memetic_fields, solve_memetic),
  };
  return list;
}

}  // namespace flamefield
