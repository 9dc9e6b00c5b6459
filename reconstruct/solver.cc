#include "reconstruct/solver.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "proto/nearest_name.h"
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
  }
  return "unknown";
}

namespace {

std::vector<SettingField> fields_of(ProjectorOptions& o) {
  return {{"pixel_samples", "", 1, 8, "k x k rays a pixel", &o.pixel_samples},
          {"step_voxels", "voxels", 0.01, 1, "ds along a ray, in units of the smallest voxel side",
           &o.step_voxels},
          {"memory_budget_mib", "MiB", 0, 1e9, "a larger matrix is traced anew instead of stored",
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

Result<> check_views(const Projections& p, const Projector& projector) {
  if (p.rows != projector.rows() || p.cols != projector.cols() ||
      p.values.size() != p.views() * p.pixels_per_view()) {
    return invalid_input(concat("projections of ", p.views(), " views with ", p.rows, "x", p.cols,
                                " (rows x cols), ", p.values.size(), " values"),
                         concat("the rig's images have ", projector.rows(), "x", projector.cols(), ", ",
                                projector.views(), " views"),
                         "use the rig that prepare wrote for these projections");
  }
  if (p.view_names != projector.view_names()) {
    std::size_t v = 0;
    while (v < std::min(p.views(), projector.views()) && p.view_names[v] == projector.view_names()[v]) ++v;
    const auto at = [v](const std::vector<std::string>& names) {
      return v < names.size() ? names[v] : std::string("missing");
    };
    return invalid_input(concat("view ", v, " is ", at(p.view_names), " in the projections, ",
                                at(projector.view_names()), " in the rig"),
                         "each view needs its camera, in the rig's order", "check rig and projections");
  }
  for (std::size_t i = 0; i < p.values.size(); ++i) {
    if (std::isfinite(p.values[i])) continue;
    const std::size_t in_view = i % p.pixels_per_view(), cols = static_cast<std::size_t>(p.cols);
    return invalid_input(
        concat("projections: ", p.values[i], " in view ", p.view_names[i / p.pixels_per_view()], ", row ",
               in_view / cols, ", column ", in_view % cols),
        "every value must be finite", "mask or repair this pixel");
  }
  return {};
}

std::vector<SettingField> fields_of_table(std::string_view table, ProjectorOptions& projector,
                                          PrepareOptions& prepare) {
  if (table == "projector") return fields_of(projector);
  return table == "prepare" ? fields_of(prepare) : std::vector<SettingField>();
}

}  // namespace

double relative_distance(std::span<const float> a, std::span<const float> b) {
  double difference = 0, size = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    const double d = static_cast<double>(a[i]) - b[i];
    difference += d * d;
    size += static_cast<double>(b[i]) * b[i];
  }
  return size > 0 ? std::sqrt(difference / size) : difference > 0 ? INFINITY : 0;
}

std::vector<std::string_view> solver_names() {
  std::vector<std::string_view> names;
  for (const Solver& solver : solvers()) names.push_back(solver.name);
  return names;
}

std::vector<SettingDoc> settings_of(std::string_view table) {
  if (const Solver* solver = find_solver(table)) return solver->settings();
  ProjectorOptions projector;
  PrepareOptions prepare;
  return describe(fields_of_table(table, projector, prepare));
}

std::string_view summary_of(std::string_view name) {
  const Solver* solver = find_solver(name);
  return solver ? solver->summary : "";
}

Result<ProjectorOptions> projector_options(const Recipe& recipe) {
  ProjectorOptions options;
  const auto fields = fields_of(options);
  if (auto ok = read_settings("projector", fields, recipe); !ok) return tl::unexpected(ok.error());
  return options;
}

Result<> validate_recipe(const Recipe& recipe) {
  if (auto solver = solver_of(recipe); !solver) return tl::unexpected(solver.error());
  std::vector<std::string_view> tables = solver_names();
  tables.insert(tables.end(), {"projector", "prepare"});
  for (const auto& [name, setting] : recipe.settings) {
    const std::string_view table = std::string_view(name).substr(0, name.find('.'));
    if (std::ranges::find(tables, table) == tables.end()) {
      return invalid_input(concat("unknown setting '", name, "'"), concat("there is no table [", table, "]"),
                           concat("did you mean [", nearest_name(table, tables), "]?"));
    }
  }
  for (const Solver& solver : solvers())
    if (auto ok = solver.check(recipe); !ok) return ok;
  if (auto ok = projector_options(recipe); !ok) return tl::unexpected(ok.error());
  if (auto ok = prepare_options(recipe); !ok) return tl::unexpected(ok.error());
  return {};
}

Result<Reconstruction> reconstruct(const Projections& projections, const Projector& projector,
                                   const Recipe& recipe, const SolveControl& control) {
  if (auto ok = validate_recipe(recipe); !ok) return tl::unexpected(ok.error());
  if (auto ok = check_views(projections, projector); !ok) return tl::unexpected(ok.error());
  const auto start = std::chrono::steady_clock::now();
  const Solver& solver = **solver_of(recipe);
  Team team(control.threads);

  // Solvers see images whose brightest pixel is 1.
  const float brightest = *std::ranges::max_element(projections.values);
  const float scale = brightest > 0 ? brightest : 1;
  std::vector<float> images = projector.layout().pack_images(projections.values);
  for (float& v : images) v /= scale;
  Solution solution = solver.run({projector, images, control, team}, recipe);

  Reconstruction out;
  projector.forward(team, solution.volume, images);
  Projections rendered = projections;
  rendered.values = projector.layout().unpack_images(images);
  for (float& v : rendered.values) v *= scale;
  out.residual = relative_distance(rendered.values, projections.values);
  out.residual_per_view = residual_per_view(projections, rendered);
  out.volume.grid = projector.grid();
  out.volume.values = projector.layout().unpack_volume(solution.volume);
  for (float& v : out.volume.values) v *= scale;
  out.solver = recipe.solver;
  out.iterations = solution.iterations;
  out.voxel_updates = solution.voxel_updates;
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
  auto projector = [&] {
    Team team(control.threads);
    return Projector::make(rig, grid, *options, team);
  }();
  if (!projector) return tl::unexpected(projector.error());
  auto out = reconstruct(projections, *projector, recipe, control);
  if (out) out->wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  return out;
}

}  // namespace flamefield
