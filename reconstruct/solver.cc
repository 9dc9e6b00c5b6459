#include "reconstruct/solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "proto/nearest_name.h"
#include "reconstruct/constraints.h"
#include "reconstruct/input_checks.h"
#include "reconstruct/metrics.h"
#include "reconstruct/prepare.h"
#include "reconstruct/problem.h"
#include "reconstruct/registry.h"

namespace flamefield {

std::string_view name_of(StopReason reason) {
  switch (reason) {
    case StopReason::Iterations:
      return "iterations";
    case StopReason::Residual:
      return "residual";
    case StopReason::Fitness:
      return "fitness";
    case StopReason::TimeLimit:
      return "time limit";
    case StopReason::Cancelled:
      return "cancelled";
    case StopReason::Discrepancy:
      return "discrepancy";
    case StopReason::Stagnation:
      return "stagnation";
    case StopReason::Converged:
      return "converged";
  }
  return "unknown";
}

namespace {

std::vector<SettingField> fields_of(ProjectorOptions& o) {
  return {{"trilinear", "", 0, 1, "the ray tracer of the paper's Eq. 1 instead of the fast projector",
           &o.trilinear},
          {"f_number", "", 0, 1000, "of the lens: what is out of focus is blurred; 0: pinhole", &o.f_number},
          {"focal_length_mm", "mm", 0, 10000, "of the lens; needed with f_number", &o.focal_length_mm},
          {"focus_distance_mm", "mm", 0, 1e7, "distance in focus; 0: the centre of the volume",
           &o.focus_distance_mm},
          {"pixel_area", "", 0, 1, "a pixel averages over its area; false: one central ray", &o.pixel_area},
          {"pixel_samples", "", 1, 8, "trilinear: k x k rays a pixel", &o.pixel_samples},
          {"step_voxels", "voxels", 0.01, 1, "trilinear: ds along a ray, in units of the smallest voxel side",
           &o.step_voxels},
          {"memory_budget_mib", "MiB", 0, 1e9, "trilinear: a larger matrix is traced anew instead of stored",
           &o.memory_budget_mib}};
}

const Solver* find_solver(std::string_view name) {
  for (const Solver& solver : solvers())
    if (solver.name == name) return &solver;
  return nullptr;
}

Result<const Solver*> solver_of(const Recipe& recipe) {
  if (const Solver* solver = find_solver(recipe.solver)) return solver;
  const auto names = solver_names();
  return invalid_input(concat("unknown solver '", recipe.solver, "'"), "no solver has this name",
                       concat("did you mean '", nearest_name(recipe.solver, names), "'?"));
}

// All ranks must be able to take part.
Result<> check_division(const Solver& solver, const Ranks* ranks) {
  if (!ranks || ranks->count() == 1 || solver.division != Division::None) return {};
  std::string able;
  for (const Solver& s : solvers())
    if (s.division != Division::None) able += concat(able.empty() ? "" : ", ", s.name);
  return invalid_input(concat("solver ", solver.name, " on ", ranks->count(), " ranks"),
                       "it works in one process only",
                       concat("run it without ranks, or choose one of ", able));
}

// What a recipe says beside its solvers' own tables.
struct SharedOptions {
  ProjectorOptions projector;
  PrepareOptions prepare;
  Constraints constraints;
  StopRules stop;
  NoiseModel noise;
};
struct SharedTable {
  std::string_view name;
  std::vector<SettingField> fields;
};
std::vector<SharedTable> tables_of(SharedOptions& o) {
  return {{"projector", fields_of(o.projector)},
          {"prepare", fields_of(o.prepare)},
          {"constraints", fields_of(o.constraints)},
          {"stop", fields_of(o.stop)},
          {"noise", fields_of(o.noise)}};
}

Result<SharedOptions> shared_options(const Recipe& recipe) {
  SharedOptions options;
  for (const SharedTable& table : tables_of(options))
    if (auto ok = read_settings(table.name, table.fields, recipe); !ok) return tl::unexpected(ok.error());
  return options;
}

}  // namespace

std::vector<std::string_view> shared_tables() {
  SharedOptions options;
  std::vector<std::string_view> names;
  for (const SharedTable& table : tables_of(options)) names.push_back(table.name);
  return names;
}

std::vector<std::string_view> solver_names() {
  std::vector<std::string_view> names;
  for (const Solver& solver : solvers()) names.push_back(solver.name);
  return names;
}

std::vector<SettingDoc> settings_of(std::string_view table) {
  if (const Solver* solver = find_solver(table)) return solver->settings();
  SharedOptions options;
  for (const SharedTable& shared : tables_of(options))
    if (shared.name == table) return describe(shared.fields);
  return {};
}

std::string_view summary_of(std::string_view name) {
  const Solver* solver = find_solver(name);
  return solver ? solver->summary : "";
}

Division division_of(std::string_view name) {
  const Solver* solver = find_solver(name);
  return solver ? solver->division : Division::None;
}

bool takes_warm_start(std::string_view name) {
  const Solver* solver = find_solver(name);
  return solver && solver->takes_start;
}

Result<ProjectorOptions> projector_options(const Recipe& recipe) {
  const auto options = shared_options(recipe);
  if (!options) return tl::unexpected(options.error());
  return options->projector;
}

Result<> validate_recipe(const Recipe& recipe) {
  if (auto solver = solver_of(recipe); !solver) return tl::unexpected(solver.error());
  std::vector<std::string_view> tables = solver_names();
  const std::vector<std::string_view> shared = shared_tables();
  tables.insert(tables.end(), shared.begin(), shared.end());
  for (const auto& [name, setting] : recipe.settings) {
    const std::string_view table = std::string_view(name).substr(0, name.find('.'));
    if (std::ranges::find(tables, table) == tables.end()) {
      return invalid_input(concat("unknown setting '", name, "'"), concat("there is no table [", table, "]"),
                           concat("did you mean [", nearest_name(table, tables), "]?"));
    }
  }
  for (const Solver& solver : solvers())
    if (auto ok = solver.check(recipe); !ok) return ok;
  if (auto ok = shared_options(recipe); !ok) return tl::unexpected(ok.error());
  return {};
}

Result<Reconstruction> reconstruct(const Projections& projections, const Projector& projector,
                                   const Recipe& recipe, const SolveControl& control) {
  if (auto ok = validate_recipe(recipe); !ok) return tl::unexpected(ok.error());
  if (auto ok = check_views(projections, projector); !ok) return tl::unexpected(ok.error());
  const auto start = std::chrono::steady_clock::now();
  const Solver& solver = **solver_of(recipe);
  const Share& share = projector.share();
  const Grid& whole = share.whole();
  if (control.start && !solver.takes_start) {
    return invalid_input("a warm start", concat("solver ", solver.name, " has no use for one"),
                         "leave it out or choose an iterative solver, e.g. sirt");
  }
  if (control.start)
    if (auto ok = check_start(*control.start, whole); !ok) return tl::unexpected(ok.error());
  if (auto ok = check_division(solver, control.ranks); !ok) return tl::unexpected(ok.error());
  const SharedOptions shared = *shared_options(recipe);
  Team team(control.threads);
  if (auto ok = check_sight(projector, team); !ok) return tl::unexpected(ok.error());

  // Solvers see images whose brightest pixel is 1.
  const float brightest = *std::ranges::max_element(projections.values);
  const float scale = brightest > 0 ? brightest : 1;
  const Layout& layout = projector.layout();
  std::vector<float> images = layout.pack_images(projections.values);
  for (float& v : images) v /= scale;
  Problem problem{projector, images, control, team};
  problem.non_negative = shared.constraints.non_negative;
  problem.stop = shared.stop;
  problem.noise = shared.noise;
  problem.brightness = scale;
  if (problem.stop.discrepancy > 0)
    problem.stop.expected_residual = expected_residual(noise_of(problem), images, layout);
  std::vector<std::uint8_t> support;
  if (shared.constraints.visual_hull)
    support = visual_hull(projector, images, shared.constraints.hull_threshold, team);
  problem.support = support;
  std::vector<float> warm;
  if (control.start) {
    const std::size_t plane = whole.index(0, 0, 1);
    warm = layout.pack_volume(
        std::span(control.start->values)
            .subspan(static_cast<std::size_t>(share.planes().begin) * plane, projector.grid().voxels()));
  }
  for (float& v : warm) v /= scale;
  problem.start = warm;
  auto solved = solver.run(problem, recipe);
  if (!solved) return tl::unexpected(solved.error());
  Solution& solution = *solved;

  Reconstruction out;
  if (solution.images.empty()) {
    projector.forward(team, solution.volume, images);
  } else {
    images = std::move(solution.images);
  }
  Projections rendered = projections;
  rendered.values = layout.unpack_images(images);
  for (float& v : rendered.values) v *= scale;
  out.residual = relative_distance(rendered.values, projections.values);
  out.residual_per_view = residual_per_view(projections, rendered);
  out.volume.grid = whole;
  out.volume.values = share.collect(layout.unpack_volume(solution.volume));
  for (float& v : out.volume.values) v *= scale;
  if (!solution.sigma.empty()) out.sigma = layout.unpack_volume(solution.sigma);
  for (float& s : out.sigma) s *= scale;
  out.notes = notes_about(projections);
  out.notes.insert(out.notes.end(), solution.notes.begin(), solution.notes.end());
  out.cameras = std::move(solution.cameras);
  out.solver = recipe.solver;
  out.iterations = solution.iterations;
  out.voxel_updates = solution.voxel_updates;
  out.offspring = solution.offspring;
  out.projector_engine = projector.engine();
  out.stop_reason = solution.stop_reason;
  out.history = std::move(solution.history);
  out.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

Result<Reconstruction> reconstruct(const Projections& projections, const Rig& rig, const Grid& grid,
                                   const Recipe& recipe, const SolveControl& control) {
  if (auto ok = validate_recipe(recipe); !ok) return tl::unexpected(ok.error());
  const auto start = std::chrono::steady_clock::now();
  const auto options = projector_options(recipe);
  if (!options) return tl::unexpected(options.error());
  if (auto ok = check_division(**solver_of(recipe), control.ranks); !ok) return tl::unexpected(ok.error());
  auto projector = [&] {
    Team team(control.threads);
    return Projector::make(rig, grid, *options, team,
                           division_of(recipe.solver) == Division::Slabs ? control.ranks : nullptr);
  }();
  if (!projector) return tl::unexpected(projector.error());
  auto out = reconstruct(projections, *projector, recipe, control);
  if (out) out->wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

}  // namespace flamefield
