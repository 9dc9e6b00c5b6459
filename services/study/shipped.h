#pragma once

#include <span>
#include <string_view>

namespace flamefield {

// The files of deploy/recipes travel inside the program: studies work wherever it is installed.
struct ShippedRecipe {
  std::string_view name;  // of the file, without .toml
  std::string_view text;
};
std::span<const ShippedRecipe> shipped_recipes();

}  // namespace flamefield
