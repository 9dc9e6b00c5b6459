#include "reconstruct/registry.h"

#include "proto/check.h"
#include "reconstruct/algebraic/sirt.h"
#include "reconstruct/evolutionary/ert.h"
#include "reconstruct/statistical/mlem.h"

namespace flamefield {

namespace {

// A solver whose recipe table is named like it and holds the fields of Options.
template <class Options, class Answer>  // Answer: Solution or Result<Solution>
Solver entry(std::string_view name, std::string_view summary, Options defaults,
             std::vector<SettingField> (*fields)(Options&), Answer (*solve)(const Problem&, const Options&),
             bool takes_start = true) {
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
          takes_start};
}

}  // namespace

std::span<const Solver> solvers() {
  static const std::vector<Solver> list = {
      entry("osem", "MLEM with ordered subsets of views (Hudson and Larkin 1994)",
            MlemOptions{.max_iterations = 12, .subsets = 5, .smoothing = 0.3}, osem_fields, solve_mlem),
      entry("mlem", "maximum likelihood for Poisson data (Shepp and Vardi 1982), smoothed EM", MlemOptions{},
            mlem_fields, solve_mlem),
      entry("sirt", "simultaneous iterative reconstruction (Gilbert 1972), non-negative", SirtOptions{},
            sirt_fields, solve_sirt),
      entry("os-sart", "SIRT with ordered subsets of views (Andersen and Kak 1984), non-negative",
            SirtOptions{.max_iterations = 20, .relaxation = 1, .smoothing = 0.1, .subsets = 5},
            os_sart_fields, solve_sirt),
      entry("ert",
            "evolutionary reconstruction: genetic operators at Metropolis-drawn voxels (Energies 12, 2019)",
            ErtOptions{}, ert_fields, solve_ert, false),
  };
  return list;
}

}  // namespace flamefield
