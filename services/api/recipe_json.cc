#include "services/api/recipe_json.h"

#include <nlohmann/json.hpp>

namespace flamefield {

nlohmann::ordered_json settings_json_of(const Recipe& recipe) {
  auto json = nlohmann::ordered_json::object();
  for (const auto& [key, value] : recipe.settings)
    std::visit([&, k = key](const auto& v) { json[k] = v; }, value);
  return json;
}

Result<Recipe> recipe_from(const nlohmann::json& json) {
  Recipe recipe;
  const auto wrong = [](const std::string& what) {
    return invalid_input(what, "it is of the wrong type", "see /api/v1/solvers");
  };
  if (json.contains("solver")) {
    if (!json["solver"].is_string()) return wrong("solver");
    recipe.solver = json["solver"].get<std::string>();
  }
  if (!json.contains("settings")) return recipe;
  if (!json["settings"].is_object()) return wrong("settings");
  for (const auto& [key, value] : json["settings"].items()) {
    if (value.is_boolean()) {
      recipe.settings[key] = value.get<bool>();
    } else if (value.is_number_integer()) {
      recipe.settings[key] = value.get<std::int64_t>();
    } else if (value.is_number()) {
      recipe.settings[key] = value.get<double>();
    } else if (value.is_string()) {
      recipe.settings[key] = value.get<std::string>();
    } else {
      return wrong("setting " + key);
    }
  }
  return recipe;
}

}  // namespace flamefield
