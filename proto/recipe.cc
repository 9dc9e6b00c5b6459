#include "proto/recipe.h"

#include <charconv>

#include "proto/fingerprint.h"

namespace flamefield {

std::string text_of(const Setting& setting) {
  return std::visit(
      [](const auto& value) -> std::string {
        using T = std::decay_t<decltype(value)>;
        if constexpr (std::is_same_v<T, std::string>)
          return value;
        else if constexpr (std::is_same_v<T, bool>)
          return value ? "true" : "false";
        else {
          char buffer[40];
          const auto end = std::to_chars(buffer, buffer + sizeof buffer, value).ptr;
          return {buffer, end};
        }
      },
      setting);
}

namespace {

Setting parse(std::string_view text) {
  if (text == "true") return true;
  if (text == "false") return false;
  std::int64_t integer = 0;
  const char* end = text.data() + text.size();
  if (auto r = std::from_chars(text.data(), end, integer); r.ec == std::errc() && r.ptr == end)
    return integer;
  double real = 0;
  if (auto r = std::from_chars(text.data(), end, real); r.ec == std::errc() && r.ptr == end) return real;
  return std::string(text);
}

}  // namespace

Result<> assign(Recipe& recipe, std::string_view assignment) {
  const auto equals = assignment.find('=');
  const auto dot = assignment.substr(0, equals).find('.');
  if (equals == std::string_view::npos || dot == std::string_view::npos || dot == 0 || dot + 1 == equals) {
    return invalid_input(concat("setting '", assignment, "'"), "expected TABLE.KEY=VALUE",
                         "e.g. --set mlem.max_iterations=80");
  }
  recipe.settings[std::string(assignment.substr(0, equals))] = parse(assignment.substr(equals + 1));
  return {};
}

std::string fingerprint(const Recipe& recipe) {
  Fingerprint print;
  print.add(recipe.solver);
  for (const auto& [key, value] : recipe.settings) {
    print.add(key);
    print.add(static_cast<std::uint64_t>(value.index()));
    print.add(text_of(value));
  }
  return print.text();
}

}  // namespace flamefield
