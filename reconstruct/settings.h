#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/recipe.h"

namespace flamefield {

// A setting with named values.
struct Choice {
  std::span<const std::string_view> names;  // must outlive it, e.g. a constant
  void* target;
  std::size_t (*get)(const void* target);  // index into names
  void (*set)(void* target, std::size_t index);
};
// Of an enumeration whose values count from 0 in the order of the names.
template <class Enum>
Choice choice_of(Enum& target, std::span<const std::string_view> names) {
  return {names, &target,
          [](const void* at) { return static_cast<std::size_t>(*static_cast<const Enum*>(at)); },
          [](void* at, std::size_t index) { *static_cast<Enum*>(at) = static_cast<Enum>(index); }};
}

// One key of a recipe table. `target` points into an options aggregate whose initial value is the default.
struct SettingField {
  std::string_view key;
  std::string_view unit;     // "" for pure numbers
  double low = 0, high = 0;  // closed range; ignored for bool and choices
  std::string_view doc;
  std::variant<bool*, int*, double*, Choice> target;
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
