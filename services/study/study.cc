#include "services/study/study.h"

#include <algorithm>

namespace flamefield {

std::optional<double> number_of(const Setting& setting) {
  if (const auto* real = std::get_if<double>(&setting)) return *real;
  if (const auto* integer = std::get_if<std::int64_t>(&setting)) return static_cast<double>(*integer);
  return std::nullopt;
}

std::string spoken(std::string_view key) {
  if (key == "phantom.kind" || key == "phantom.field") return "phantom";
  if (const auto dot = key.find('.'); dot != std::string_view::npos) key = key.substr(dot + 1);
  std::string out(key);
  std::ranges::replace(out, '_', ' ');
  for (const auto& [unit, mark] : {std::pair{" mm", " (mm)"}, {" deg", " (deg)"}, {" s", " (s)"}})
    if (out.ends_with(unit)) out.replace(out.size() - std::string_view(unit).size(), std::string::npos, mark);
  return out;
}

std::string StudyRun::label() const {
  std::string out = case_name;
  for (const auto& [key, value] : swept) {
    if (!out.empty()) out += ", ";
    const bool is_name = std::holds_alternative<std::string>(value);
    out += is_name ? text_of(value) : concat(spoken(key), " ", text_of(value));
  }
  if (repeat > 0) out += concat(out.empty() ? "" : ", ", "seed ", settings.seed);
  return out;
}

}  // namespace flamefield
