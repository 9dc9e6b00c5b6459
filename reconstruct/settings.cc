#include "reconstruct/settings.h"

#include <algorithm>
#include <cmath>

#include "proto/nearest_name.h"

namespace flamefield {

namespace {

std::string range_text(const SettingField& field) {
  if (std::holds_alternative<bool*>(field.target)) return "true or false";
  if (const auto* choice = std::get_if<Choice>(&field.target)) {
    std::string names;
    for (std::string_view name : choice->names) names.append(names.empty() ? "" : " | ").append(name);
    return names;
  }
  const bool bounded = field.high < 1e12;
  return bounded ? concat(field.low, " .. ", field.high) : concat(">= ", field.low);
}

std::string value_text(const SettingField& field) {
  if (const auto* choice = std::get_if<Choice>(&field.target))
    return std::string(choice->names[choice->get(choice->target)]);
  return std::visit(
      [](const auto& v) -> std::string {
        if constexpr (std::is_pointer_v<std::decay_t<decltype(v)>>) return concat(std::boolalpha, *v);
        return {};
      },
      field.target);
}

Result<> store(std::string_view name, const SettingField& field, const Setting& setting) {
  const auto wrong = [&](std::string_view why) {
    return invalid_input(concat(name, "=", text_of(setting)), why,
                         concat("range: ", range_text(field), field.unit.empty() ? "" : " ", field.unit));
  };
  if (auto* const* target = std::get_if<bool*>(&field.target)) {
    if (!std::holds_alternative<bool>(setting)) return wrong("must be true or false");
    **target = std::get<bool>(setting);
    return {};
  }
  if (const auto* choice = std::get_if<Choice>(&field.target)) {
    const auto named = std::ranges::find(choice->names, text_of(setting));
    if (named == choice->names.end()) return wrong("no such choice");
    choice->set(choice->target, static_cast<std::size_t>(named - choice->names.begin()));
    return {};
  }
  const bool integer = std::holds_alternative<std::int64_t>(setting);
  if (!integer && !std::holds_alternative<double>(setting)) return wrong("must be a number");
  const double value =
      integer ? static_cast<double>(std::get<std::int64_t>(setting)) : std::get<double>(setting);
  if (!(value >= field.low && value <= field.high)) return wrong("out of range");
  if (auto* const* target = std::get_if<int*>(&field.target)) {
    if (!integer) return wrong("must be a whole number");
    **target = static_cast<int>(value);
  } else {
    *std::get<double*>(field.target) = value;
  }
  return {};
}

}  // namespace

std::vector<SettingDoc> describe(std::span<const SettingField> fields) {
  std::vector<SettingDoc> out;
  for (const SettingField& field : fields) {
    const std::string value = value_text(field);
    out.push_back(
        {std::string(field.key), std::string(field.unit), range_text(field), value, std::string(field.doc)});
  }
  return out;
}

Result<> read_settings(std::string_view table, std::span<const SettingField> fields, const Recipe& recipe) {
  for (const auto& [name, setting] : recipe.settings) {
    const auto dot = name.find('.');
    if (std::string_view(name).substr(0, dot) != table) continue;
    const std::string_view key = dot == std::string::npos ? "" : std::string_view(name).substr(dot + 1);
    const auto field = std::ranges::find(fields, key, &SettingField::key);
    if (field == fields.end()) {
      std::vector<std::string_view> keys;
      for (const SettingField& f : fields) keys.push_back(f.key);
      return invalid_input(concat("unknown setting '", name, "'"),
                           concat("table [", table, "] has no such key"),
                           concat("did you mean '", table, ".", nearest_name(key, keys), "'?"));
    }
    if (auto ok = store(name, *field, setting); !ok) return ok;
  }
  return {};
}

}  // namespace flamefield
