#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <variant>

#include "proto/error.h"

namespace flamefield {

using Setting = std::variant<bool, std::int64_t, double, std::string>;

// How a frame set becomes a volume: which solver, and every setting that differs from the defaults.
// Keys are "table.key", as in the TOML file and in --set; each stage knows its own tables and refuses
// keys that it does not know, so a recipe is checked in full before any work starts.
struct Recipe {
  std::string solver = "hessian";
  std::map<std::string, Setting, std::less<>> settings;

  bool operator==(const Recipe&) const = default;
};

std::string text_of(const Setting& setting);

// "table.key=value" -> one more setting (true/false, integer, real, else text). InvalidInput on bad grammar.
Result<> assign(Recipe& recipe, std::string_view assignment);

// A short hexadecimal name: equal for equal recipes.
std::string fingerprint(const Recipe& recipe);

}  // namespace flamefield
