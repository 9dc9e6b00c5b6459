#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "proto/recipe.h"

namespace CLI {
class App;
}

namespace flamefield {

// --recipe, --solver and --set: the file first, then what the command line says.
struct RecipeOptions {
  std::filesystem::path file;
  std::string solver;
  std::vector<std::string> settings;

  // Checked against every stage; ends the command with exit code 2 otherwise.
  Recipe recipe() const;
};
void add_recipe(CLI::App& command, RecipeOptions& options);

}  // namespace flamefield
