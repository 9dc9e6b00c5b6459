#pragma once

#include <nlohmann/json_fwd.hpp>

#include "proto/error.h"
#include "proto/recipe.h"

namespace flamefield {

// {"table.key": value, ...}
nlohmann::ordered_json settings_json_of(const Recipe& recipe);

// From {"solver": NAME, "settings": {"table.key": value, ...}}; what is missing stays at its default.
// InvalidInput: a value that is neither true or false, number nor text. Whether the solver knows the keys is
// not looked at.
Result<Recipe> recipe_from(const nlohmann::json& json);

}  // namespace flamefield
