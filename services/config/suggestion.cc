#include "services/config/suggestion.h"

#include <algorithm>
#include <numeric>

#include "proto/error.h"

namespace flamefield {

namespace {

// Levenshtein: how many letters to insert, remove or change.
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t change = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({change, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

std::string suggest(std::string_view name, const std::vector<std::string_view>& known) {
  const auto nearest = std::min_element(known.begin(), known.end(), [&](auto a, auto b) {
    return edits_between(name, a) < edits_between(name, b);
  });
  if (nearest != known.end() &&
      edits_between(name, *nearest) <= std::max<std::size_t>(2, nearest->size() / 3))
    return concat("did you mean '", *nearest, "'?");
  std::string list = "choose one of:";
  for (std::string_view candidate : known) list.append(" ").append(candidate);
  return list;
}

}  // namespace flamefield
