#pragma once

#include <filesystem>
#include <functional>
#include <string>

#include "proto/recipe.h"

namespace flamefield {

// Says whether the stages know a recipe's solver and keys, e.g. validate_recipe of reconstruct/solver.h.
using RecipeCheck = std::function<Result<>(const Recipe&)>;

// A recipe in TOML: `solver = "mlem"` at the top, every other key in a table. `check` is asked about each key
// on its own, so that an error names the file and the line. `defaults` holds where the file says nothing.
Result<Recipe> read_recipe(const std::filesystem::path& path, const RecipeCheck& check,
                           const Recipe& defaults = {});

// The same from text, e.g. of a recipe that is part of the program; `name` is what errors call it.
Result<Recipe> parse_recipe(const std::string& text, const std::filesystem::path& name,
                            const RecipeCheck& check, const Recipe& defaults = {});

// The recipe as TOML text, and written to a file.
std::string toml_of(const Recipe& recipe);
Result<> write_recipe(const std::filesystem::path& path, const Recipe& recipe);

}  // namespace flamefield
