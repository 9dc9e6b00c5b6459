#include "services/study/settings.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <numbers>

#include "proto/fingerprint.h"
#include "proto/nearest_name.h"
#include "proto/version.h"
#include "reconstruct/phantom/setup.h"
#include "reconstruct/solver.h"
#include "services/config/recipe_file.h"
#include "services/study/shipped.h"

namespace flamefield {

namespace {

constexpr std::array<std::string_view, 6> kKinds = {"torus",  "hollow-sphere", "gaussian",
                                                    "bunsen", "swirl",         "stratified"};
constexpr double kDegree = std::numbers::pi / 180;

struct Table {
  std::string_view name;
  std::vector<SettingField> fields;
};

// The tables of a run that are not the recipe's.
std::vector<Table> scene_tables(RunSettings& run, int& phantom_seed) {
  return {{"phantom",
           {{"kind", "", 0, 0, "which known field", choice_of(run.phantom.kind, kKinds)},
            {"seed", "", 0, 2e9, "of the turbulence", &phantom_seed},
            {"time_s", "s", -1e6, 1e6, "the flames evolve in time", &run.phantom.time_s},
            {"nx", "voxels", 2, 4096, "grid of the reconstruction", &run.nx},
            {"ny", "voxels", 2, 4096, "grid of the reconstruction", &run.ny},
            {"nz", "voxels", 2, 4096, "grid of the reconstruction", &run.nz},
            {"spacing_mm", "mm", 1e-6, 1e6, "side of a voxel of that grid", &run.spacing_mm},
            {"finer", "", 1, 16, "voxels of the known field are so many times smaller", &run.finer}}},
          {"cameras",
           {{"views", "", 1, 1000, "cameras in the ring", &run.views},
            {"spacing_deg", "deg", -360, 360, "azimuth between neighbours", &run.spacing_deg},
            {"radius_mm", "mm", 1e-3, 1e7, "camera to the centre of the domain", &run.radius_mm},
            {"elevation_deg", "deg", -89, 89, "of the ring above the horizon", &run.elevation_deg},
            {"width_px", "px", 0, 16384, "0: as many as voxels in x", &run.width_px},
            {"height_px", "px", 0, 16384, "0: as many as voxels in y", &run.height_px}}},
          {"images",
           {{"pixel_samples", "", 1, 16, "k x k rays a pixel", &run.pixel_samples},
            {"step_voxels", "voxels", 0.01, 4, "step along a ray, in voxels of the known field",
             &run.step_voxels},
            {"noise", "", 0, 10, "Gaussian, share of the brightest pixel", &run.noise},
            {"photons", "", 0, 1e12, "at the brightest pixel; 0: no shot noise", &run.photons},
            {"read_noise", "", 0, 1e9, "standard deviation in photons", &run.read_noise},
            {"bits", "", 0, 16, "of the camera; 0: no quantisation", &run.bits},
            {"seed", "", 0, 2e9, "of the noise", &run.noise_seed}}}};
}
Table solve_table(RunSettings& run) {
  return {"solve",
          {{"seed", "", 0, 2e9, "of the stochastic solvers", &run.seed},
           {"time_limit_s", "s", 0, 1e7, "keeps the best so far; 0: none", &run.time_limit_s}}};
}

// Exact, unlike what is printed for people.
std::string exact_text(const SettingField& field) {
  return std::visit(
      [](const auto& target) -> std::string {
        using T = std::decay_t<decltype(target)>;
        if constexpr (std::is_same_v<T, Choice>)
          return std::string(target.names[target.get(target.target)]);
        else if constexpr (std::is_same_v<T, bool*>)
          return *target ? "true" : "false";
        else
          return text_of(Setting(static_cast<double>(*target)));
      },
      field.target);
}

void add(Fingerprint& print, const Table& table) {
  print.add(std::string(table.name));
  for (const SettingField& field : table.fields) {
    print.add(std::string(field.key));
    print.add(exact_text(field));
  }
}

void take_setup(RunSettings& run) {
  const PhantomSetup setup = paper_setup(run.phantom.kind);
  run.nx = setup.nx, run.ny = setup.ny, run.nz = setup.nz;
  run.spacing_mm = setup.spacing_mm;
  run.views = setup.views;
  run.spacing_deg = setup.view_spacing_rad / kDegree;
  run.radius_mm = setup.radius_mm;
}

// The grid and ring of a field from a file, unless the settings say otherwise: fifteen cameras, 12 degrees.
Result<> take_field(RunSettings& run, const Settings& settings, FieldFiles& fields) {
  std::optional<double> spacing_mm;
  if (const auto given = settings.find("phantom.field_spacing_mm"); given != settings.end()) {
    if (const double* value = std::get_if<double>(&given->second)) spacing_mm = *value;
    if (const auto* value = std::get_if<std::int64_t>(&given->second))
      spacing_mm = static_cast<double>(*value);
    if (!spacing_mm || !(*spacing_mm > 0) || !std::isfinite(*spacing_mm))
      return invalid_input(concat("phantom.field_spacing_mm=", text_of(given->second)),
                           "must be a positive number", "give the side of the file's voxels in mm");
  }
  run.field_spacing_mm = spacing_mm;
  const auto field = fields.get(run.field, spacing_mm);
  if (!field) return tl::unexpected(field.error());
  const Grid& g = (*field)->volume.grid;
  run.field_fingerprint = (*field)->fingerprint;
  run.finer = 2;
  if (const auto given = settings.find("phantom.finer"); given != settings.end())
    if (const auto* finer = std::get_if<std::int64_t>(&given->second); finer && *finer >= 1 && *finer <= 16)
      run.finer = static_cast<int>(*finer);
  run.nx = std::max(2, g.nx / run.finer), run.ny = std::max(2, g.ny / run.finer),
  run.nz = std::max(2, g.nz / run.finer);
  run.spacing_mm = g.spacing_mm.x() * run.finer;
  run.views = 15, run.spacing_deg = 12;
  run.radius_mm = std::max(300.0, 4.4 * std::max(run.nx, run.nz) * run.spacing_mm);
  return {};
}

std::string text_at(const Settings& settings, std::string_view key) {
  const auto found = settings.find(key);
  return found == settings.end() ? "" : text_of(found->second);
}

bool is_ours(std::string_view table) {
  return table == "phantom" || table == "cameras" || table == "images" || table == "solve";
}

Result<Recipe> read_recipe_part(const Settings& settings, const std::filesystem::path& folder) {
  Recipe recipe;
  if (const std::string name = text_at(settings, "recipe"); !name.empty()) {
    auto named = named_recipe(name, folder);
    if (!named) return named;
    recipe = std::move(*named);
  }
  if (const std::string solver = text_at(settings, "solver"); !solver.empty()) recipe.solver = solver;
  for (const auto& [key, value] : settings) {
    const std::string_view table = std::string_view(key).substr(0, key.find('.'));
    if (key.find('.') == std::string::npos || is_ours(table)) continue;
    recipe.settings[key] = value;
  }
  if (auto ok = validate_recipe(recipe); !ok) return tl::unexpected(ok.error());
  // What the chosen solver never reads makes no different run.
  const auto shared = shared_tables();
  std::erase_if(recipe.settings, [&](const auto& item) {
    const std::string_view table = std::string_view(item.first).substr(0, item.first.find('.'));
    return table != recipe.solver && std::ranges::find(shared, table) == shared.end();
  });
  return recipe;
}

}  // namespace

Result<Recipe> named_recipe(const std::string& name, const std::filesystem::path& folder) {
  for (const ShippedRecipe& shipped : shipped_recipes())
    if (shipped.name == name || concat(shipped.name, ".toml") == name)
      return parse_recipe(std::string(shipped.text), name, validate_recipe);
  const std::filesystem::path path = folder / name;
  if (std::filesystem::exists(path)) return read_recipe(path, validate_recipe);
  std::vector<std::string_view> known;
  for (const ShippedRecipe& shipped : shipped_recipes())
    if (!shipped.name.starts_with("study-")) known.push_back(shipped.name);
  return not_found(concat("recipe '", name, "'"), concat("neither shipped nor at ", path.string()),
                   concat("did you mean '", nearest_name(name, known), "'?"));
}

Result<RunSettings> read_run_settings(const Settings& settings, const std::filesystem::path& folder,
                                      FieldFiles& fields) {
  RunSettings run;
  int phantom_seed = 1;
  Recipe all;  // the tables are read with what recipes are read with
  all.settings.insert(settings.begin(), settings.end());
  all.settings.erase("phantom.field");
  all.settings.erase("phantom.field_spacing_mm");
  if (const std::string file = text_at(settings, "phantom.field"); !file.empty()) {
    run.field = std::filesystem::path(file).is_absolute() ? std::filesystem::path(file) : folder / file;
    if (settings.contains("phantom.kind"))
      return invalid_input("both phantom.kind and phantom.field", "a field is generated or read, not both",
                           "leave one of them out");
    if (auto ok = take_field(run, settings, fields); !ok) return tl::unexpected(ok.error());
  } else {
    if (settings.contains("phantom.field_spacing_mm"))
      return invalid_input("phantom.field_spacing_mm without phantom.field", "a phantom has spacing_mm",
                           "give the field or phantom.spacing_mm");
    const SettingField kind{"kind", "", 0, 0, "", choice_of(run.phantom.kind, kKinds)};
    if (const auto given = settings.find("phantom.kind"); given != settings.end()) {
      const auto name = text_of(given->second);
      if (std::ranges::find(kKinds, name) == kKinds.end())
        return invalid_input(concat("phantom.kind=", name), "there is no phantom of this name",
                             concat("did you mean '", nearest_name(name, kKinds), "'?"));
      if (auto ok = read_settings("phantom", std::array{kind}, {"", {{"phantom.kind", given->second}}}); !ok)
        return tl::unexpected(ok.error());
    }
    take_setup(run);
  }
  for (const Table& table : scene_tables(run, phantom_seed))
    if (auto ok = read_settings(table.name, table.fields, all); !ok) return tl::unexpected(ok.error());
  const Table solve = solve_table(run);
  if (auto ok = read_settings(solve.name, solve.fields, all); !ok) return tl::unexpected(ok.error());
  run.phantom.seed = static_cast<std::uint64_t>(phantom_seed);
  auto recipe = read_recipe_part(settings, folder);
  if (!recipe) return tl::unexpected(recipe.error());
  run.recipe = std::move(*recipe);
  if (auto ok = validate(run.grid()); !ok) return tl::unexpected(ok.error());
  return run;
}

Grid RunSettings::grid() const {
  return centred_grid(nx, ny, nz, spacing_mm);
}

RingOptions RunSettings::ring() const {
  return {views, spacing_deg * kDegree, radius_mm, elevation_deg * kDegree, width_px, height_px};
}

std::string RunSettings::scene_id() const {
  RunSettings copy = *this;
  int phantom_seed = static_cast<int>(phantom.seed);
  if (!evolves(phantom.kind) || !field.empty()) phantom_seed = 0, copy.phantom.time_s = 0;
  if (noise == 0 && photons == 0) copy.noise_seed = 0;
  Fingerprint print;
  print.add(field_fingerprint);
  for (const Table& table : scene_tables(copy, phantom_seed)) add(print, table);
  return print.text();
}

std::string RunSettings::id() const {
  RunSettings copy = *this;
  Fingerprint print;
  print.add(std::string(program_version()));
  print.add(scene_id());
  print.add(fingerprint(recipe));
  add(print, solve_table(copy));
  return print.text();
}

std::string phantom_name(const RunSettings& run) {
  return run.field.empty() ? std::string(name_of(run.phantom.kind)) : run.field.stem().string();
}

}  // namespace flamefield
