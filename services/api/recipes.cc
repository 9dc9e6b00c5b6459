// GET solvers, recipes, recipes/NAME; PUT and DELETE recipes/NAME; POST recipes (check only)
#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "reconstruct/solver.h"
#include "services/api/call.h"
#include "services/api/recipe_json.h"
#include "services/config/recipe_file.h"
#include "services/study/shipped.h"

namespace flamefield {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

Json settings_json(std::string_view table) {
  Json settings = Json::array();
  for (const SettingDoc& doc : settings_of(table)) {
    settings.push_back({{"key", concat(table, ".", doc.key)},
                        {"unit", doc.unit},
                        {"range", doc.range},
                        {"default", doc.default_value},
                        {"doc", doc.doc}});
  }
  return settings;
}

Json solvers_json() {
  Json solvers = Json::array(), shared = Json::array();
  for (const std::string_view name : solver_names())
    solvers.push_back({{"name", name}, {"summary", summary_of(name)}, {"settings", settings_json(name)}});
  for (const std::string_view table : shared_tables())
    shared.push_back({{"table", table}, {"settings", settings_json(table)}});
  return {{"solvers", std::move(solvers)}, {"shared", std::move(shared)}};
}

Json json_of(const Recipe& recipe, const std::string& name, bool is_shipped) {
  return {{"name", name},
          {"is_shipped", is_shipped},
          {"solver", recipe.solver},
          {"settings", settings_json_of(recipe)},
          {"fingerprint", fingerprint(recipe)},
          {"toml", toml_of(recipe)}};
}

fs::path folder_of(const Call& call) {
  return call.services.data_dir() / "recipes";
}

// Those that came with the program, then the laboratory's own.
Json recipes_json(const Call& call) {
  Json recipes = Json::array();
  for (const ShippedRecipe& shipped : shipped_recipes()) {
    if (shipped.name.starts_with("study-")) continue;
    const auto recipe = parse_recipe(std::string(shipped.text), std::string(shipped.name), validate_recipe);
    if (recipe) recipes.push_back(json_of(*recipe, std::string(shipped.name), true));
  }
  std::vector<fs::path> files;
  std::error_code failed;
  for (const auto& entry : fs::directory_iterator(folder_of(call), failed)) {
    if (entry.path().extension() == ".toml") files.push_back(entry.path());
  }
  std::ranges::sort(files);
  for (const fs::path& file : files) {
    const auto recipe = read_recipe(file, validate_recipe);
    if (recipe) {
      recipes.push_back(json_of(*recipe, file.stem().string(), false));
    } else {
      recipes.push_back(
          {{"name", file.stem().string()}, {"is_shipped", false}, {"error", recipe.error().message}});
    }
  }
  return {{"recipes", std::move(recipes)}};
}

Result<Recipe> recipe_in(const Call& call) {
  const auto body = call.body();
  if (!body) return tl::unexpected(body.error());
  auto recipe = recipe_from(*body);
  if (!recipe) return recipe;
  if (auto ok = validate_recipe(*recipe); !ok) return tl::unexpected(ok.error());
  return recipe;
}

HttpResponse save(const Call& call, const std::string& name) {
  const auto recipe = recipe_in(call);
  if (!recipe) return error_answer(recipe.error());
  std::error_code failed;
  fs::create_directories(folder_of(call), failed);
  const fs::path file = folder_of(call) / (name + ".toml"), part = folder_of(call) / (name + ".part");
  if (auto written = write_recipe(part, *recipe); !written) return error_answer(written.error());
  fs::rename(part, file, failed);
  if (failed) return json_error(503, "the recipe could not be written: " + failed.message());
  return json_answer(json_of(*recipe, name, false));
}

}  // namespace

std::optional<HttpResponse> answer_recipes(const Call& call) {
  const auto& [method, parts] = std::tie(call.request.method, call.parts);
  if (method == "GET" && parts.size() == 1 && parts[0] == "solvers") return json_answer(solvers_json());
  if (parts[0] != "recipes") return std::nullopt;
  if (method == "GET" && parts.size() == 1) return json_answer(recipes_json(call));
  if (method == "POST" && parts.size() == 1) {
    const auto recipe = recipe_in(call);
    return recipe ? json_answer(json_of(*recipe, "", false)) : error_answer(recipe.error());
  }
  if (parts.size() != 2 || (method != "PUT" && method != "DELETE")) return std::nullopt;
  if (!is_file_safe(parts[1]))
    return json_error(400, "a recipe's name may have letters, digits, dots, dashes and underscores");
  if (method == "PUT") return save(call, parts[1]);
  std::error_code failed;
  if (!fs::remove(folder_of(call) / (parts[1] + ".toml"), failed))
    return json_error(404, "there is no such recipe in the data directory");
  return json_answer({{"deleted", parts[1]}});
}

}  // namespace flamefield
