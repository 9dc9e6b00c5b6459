#include "services/cli/recipe_options.h"

#include <CLI/CLI.hpp>

#include "reconstruct/solver.h"
#include "services/cli/app.h"
#include "services/config/recipe_file.h"

namespace flamefield {

Recipe RecipeOptions::recipe() const {
  Recipe recipe;
  recipe.solver = solver_names().front();
  if (!file.empty()) recipe = or_usage(read_recipe(file, validate_recipe, recipe));
  if (!solver.empty()) recipe.solver = solver;
  for (const std::string& setting : settings) or_usage(assign(recipe, setting));
  or_usage(validate_recipe(recipe));
  return recipe;
}

void add_recipe(CLI::App& command, RecipeOptions& options) {
  std::string names;
  for (std::string_view name : solver_names()) names.append(names.empty() ? "" : " ").append(name);
  command.add_option("--recipe", options.file, "Settings in TOML");
  command.add_option("--solver", options.solver, "Overrides the recipe: " + names);
  command.add_option("--set", options.settings, "Overrides the recipe: TABLE.KEY=VALUE, as often as needed")
      ->allow_extra_args(false);
}

}  // namespace flamefield
