#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

#include "proto/recipe.h"
#include "reconstruct/phantom/phantom.h"
#include "reconstruct/ring.h"
#include "services/study/fields.h"

namespace flamefield {

// Flat keys of a run: "phantom.kind", "cameras.views", "ert.mutation_rate", "solver", "recipe" ... Those
// tables that are not the study's own belong to the recipe.
using Settings = std::map<std::string, Setting, std::less<>>;

// One run of a study in full: which known field, seen how, solved how.
struct RunSettings {
  // [phantom] A generated field, or one from a file, and the grid on which it is reconstructed.
  std::filesystem::path field;             // field: .npy or .vtkhdf; empty: a phantom
  std::optional<double> field_spacing_mm;  // of a file without coordinates
  std::string field_fingerprint;
  PhantomOptions phantom;  // kind, seed, time_s
  int nx = 0, ny = 0, nz = 0;
  double spacing_mm = 1;
  int finer = 3;  // the true field has voxels so many times smaller than those that are solved for
  // [cameras]
  int views = 0;
  double spacing_deg = 0, radius_mm = 300, elevation_deg = 0;
  int width_px = 0, height_px = 0;  // 0: as many pixels as voxels
  // [images]
  int pixel_samples = 3;
  double step_voxels = 0.5;
  double noise = 0;  // Gaussian, share of the brightest pixel
  double photons = 0, read_noise = 0;
  int bits = 0;
  int noise_seed = 1;
  // solver, recipe and its tables; [solve]
  Recipe recipe;
  int seed = 1;
  double time_limit_s = 0;

  Grid grid() const;
  RingOptions ring() const;
  // Names that are equal for equal work: of the images, and of the whole run.
  std::string scene_id() const;
  std::string id() const;
};

// Defaults follow the paper's set-up of the phantom. A phantom from a file is `finer` times as fine as the
// grid; `folder` is where relative paths start. InvalidInput: unknown keys with the nearest known one,
// ranges, unreadable fields and recipes.
Result<RunSettings> read_run_settings(const Settings& settings, const std::filesystem::path& folder,
                                      FieldFiles& fields);

// The recipe of a name: one of those shipped, or a file.
Result<Recipe> named_recipe(const std::string& name, const std::filesystem::path& folder);

// A short name of a phantom for tables and figures: its kind, or the file's stem.
std::string phantom_name(const RunSettings& run);

}  // namespace flamefield
