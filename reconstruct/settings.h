#pragma once

#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/recipe.h"

namespace flamefield {

// One key of a recipe table. `target` points into an options aggregate whose initial value is the default.
struct SettingField {
  std::string_view key;
  std::string_view unit;     // "" for pure numbers
  double low = 0, high = 0;  // closed range; ignored for bool
  std::string_view doc;
  std::variant<bool*, int*, double*> target;
};

// The same as text, for help pages and reports.
struct SettingDoc {
  std::string key, unit, range, default_value, doc;
};
std::vector<SettingDoc> describe(std::span<const SettingField> fields);

// Stores every setting "table.key" of the recipe in its target. InvalidInput: unknown key (with the nearest
// known one), wrong type, out of range.
Result<> read_settings(std::string_view table, std::span<const SettingField> fields, const Recipe& recipe);

}  // namespace flamefield
