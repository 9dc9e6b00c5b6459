#include "services/config/recipe_file.h"

#include <cmath>

#include "services/config/toml_file.h"
#include "services/store/file.h"

namespace flamefield {

namespace {

// "the message" -> "recipe.toml:4: the message"
tl::unexpected<Error> with_line(const TomlFile& file, const std::string& key, const Error& error) {
  return tl::unexpected(
      Error{error.code, concat(file.path.string(), ":", file.entries.at(key).line, ": ", error.message)});
}

Result<> take_solver(const TomlFile& file, const TomlEntry& entry, Recipe& recipe) {
  if (entry.is_list || !std::holds_alternative<std::string>(entry.values[0]))
    return file.fault("solver", "solver is no text", "a solver has a name", "e.g. solver = \"mlem\"");
  recipe.solver = std::get<std::string>(entry.values[0]);
  return {};
}

Result<> take_setting(const TomlFile& file, const std::string& key, const TomlEntry& entry, Recipe& recipe) {
  const auto dot = key.find('.');
  if (dot == std::string::npos) {
    return file.fault(key, concat("unknown key '", key, "'"), "only 'solver' stands outside a table",
                      concat("put it into the table of its stage, e.g. [", recipe.solver, "]"));
  }
  if (entry.is_list || key.find('.', dot + 1) != std::string::npos || key.find('[') != std::string::npos) {
    return file.fault(key, concat("'", key, "' is a list or a table within a table"),
                      "a setting is one number, text, true or false", "write one value");
  }
  recipe.settings[key] = entry.values[0];
  return {};
}

std::string toml_value(const Setting& setting) {
  if (const auto* text = std::get_if<std::string>(&setting)) return toml_text(*text);
  std::string value = text_of(setting);
  // A real without fraction stays a real.
  if (std::holds_alternative<double>(setting) && value.find_first_of(".en") == std::string::npos)
    value += ".0";
  return value;
}

Result<Recipe> recipe_of(const Result<TomlFile>& file, const RecipeCheck& check, const Recipe& defaults) {
  if (!file) return tl::unexpected(file.error());
  Recipe recipe = defaults;
  if (const auto solver = file->entries.find("solver"); solver != file->entries.end()) {
    if (auto ok = take_solver(*file, solver->second, recipe); !ok) return tl::unexpected(ok.error());
    if (auto ok = check(recipe); !ok) return with_line(*file, "solver", ok.error());
  }
  for (const auto& [key, entry] : file->entries) {
    if (key == "solver") continue;
    if (auto ok = take_setting(*file, key, entry, recipe); !ok) return tl::unexpected(ok.error());
    const Recipe alone{recipe.solver, {{key, entry.values[0]}}};
    if (auto ok = check(alone); !ok) return with_line(*file, key, ok.error());
  }
  if (auto ok = check(recipe); !ok) {  // keys that are good alone may contradict each other
    return tl::unexpected(Error{ok.error().code, concat(file->path.string(), ": ", ok.error().message)});
  }
  return recipe;
}

}  // namespace

Result<Recipe> read_recipe(const std::filesystem::path& path, const RecipeCheck& check,
                           const Recipe& defaults) {
  return recipe_of(read_toml(path), check, defaults);
}

Result<Recipe> parse_recipe(const std::string& text, const std::filesystem::path& name,
                            const RecipeCheck& check, const Recipe& defaults) {
  return recipe_of(parse_toml(text, name), check, defaults);
}

std::string toml_of(const Recipe& recipe) {
  std::string text = "solver = " + toml_text(recipe.solver) + "\n", table;
  for (const auto& [key, setting] : recipe.settings) {
    const auto dot = key.find('.');
    if (key.substr(0, dot) != table) {
      table = key.substr(0, dot);
      text += "\n[" + table + "]\n";
    }
    text += key.substr(dot + 1) + " = " + toml_value(setting) + "\n";
  }
  return text;
}

Result<> write_recipe(const std::filesystem::path& path, const Recipe& recipe) {
  return write_text_file(path, toml_of(recipe));
}

}  // namespace flamefield
