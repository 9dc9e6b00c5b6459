#include "services/bench/ert_bench.h"

#include <cmath>

#include "reconstruct/solver.h"
#include "services/bench/solver_bench.h"
#include "services/bench/stopwatch.h"

namespace flamefield {

namespace {

struct Variant {
  std::string name;
  int views;
  std::vector<std::string> settings;
};

// Operators and intensities as in the recipe ert-paper.toml.
const std::vector<std::string> kPaper = {
    "ert.scheme=paper",          "ert.pop_size=20",          "ert.lp=1.0",
    "ert.mutation_rate=0.3",     "ert.mutation_intensity=3", "ert.sigma=0.2",
    "ert.annihilation_rate=0.4", "ert.filter_rate=0.2",      "ert.filter_intensity=3"};

std::vector<std::string> with(std::vector<std::string> settings, std::initializer_list<const char*> more) {
  settings.insert(settings.end(), more.begin(), more.end());
  return settings;
}

}  // namespace

Result<std::vector<ErtRate>> measure_ert(const ErtBenchOptions& o, std::stop_token stop,
                                         const std::function<void(const std::string&)>& progress) {
  const std::vector<std::string> brood = {"ert.tolerance=0.0"};
  const std::vector<Variant> variants = {
      {"brood", o.views, brood},
      {"brood, half the views", (o.views + 1) / 2, brood},
      {"brood, twice the views", 2 * o.views, brood},
      {"paper, images from the parents'", o.views, kPaper},
      {"paper, rendered by the projector", o.views,
       with(kPaper, {"ert.incremental=false", "ert.columns_budget_mib=0"})},
      {"paper, rendered by the ray tracer", o.views,
       with(kPaper, {"ert.incremental=false", "ert.columns_budget_mib=0", "projector.trilinear=true",
                     "projector.pixel_samples=1", "projector.memory_budget_mib=0"})}};
  std::vector<ErtRate> out;
  for (const Variant& variant : variants) {
    progress(variant.name);
    const auto problem = make_solver_problem({.nx = o.nx,
                                              .ny = o.ny,
                                              .nz = o.nz,
                                              .views = variant.views,
                                              .spacing_rad = M_PI / variant.views,
                                              .threads = o.threads});
    if (!problem) return tl::unexpected(problem.error());
    Recipe recipe{"ert", {}};
    for (const std::string& setting : variant.settings)
      if (auto ok = assign(recipe, setting); !ok) return tl::unexpected(ok.error());
    Rig rig;
    rig.cameras = problem->projector.cameras();
    const auto options = projector_options(recipe);
    if (!options) return tl::unexpected(options.error());
    Team team(o.threads);
    const auto projector = Projector::make(rig, problem->projector.grid(), *options, team);
    if (!projector) return tl::unexpected(projector.error());
    // Columns are set up once; how long that takes is not what is asked.
    Recipe short_one = recipe;
    short_one.settings["ert.max_generations"] = std::int64_t{1};
    const Stopwatch set_up;
    const SolveControl brief{.threads = o.threads, .stop = stop};
    if (auto ok = reconstruct(problem->projections, *projector, short_one, brief); !ok)
      return tl::unexpected(ok.error());
    const SolveControl control{
        .threads = o.threads, .time_limit_s = set_up.wall_s() + o.seconds, .stop = stop};
    const Stopwatch watch;
    const auto solved = reconstruct(problem->projections, *projector, recipe, control);
    if (!solved) return tl::unexpected(solved.error());
    if (stop.stop_requested() || solved->history.empty()) return out;
    // From the first report to the last, when there is more than one: the columns were set up before.
    const HistoryPoint &first = solved->history.front(), &last = solved->history.back();
    ErtRate rate{variant.name, variant.views, solved->offspring, last.elapsed_s, watch.cpu_s()};
    if (last.iteration > 2 * first.iteration) {
      rate.offspring *= 1 - static_cast<double>(first.iteration) / last.iteration;
      rate.seconds -= first.elapsed_s;
    }
    out.push_back(rate);
  }
  return out;
}

}  // namespace flamefield
