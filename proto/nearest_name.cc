#include "proto/nearest_name.h"

#include <algorithm>
#include <numeric>
#include <vector>

#include "proto/check.h"

namespace flamefield {

std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);  // distances of a's beginning to each beginning of b
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t substituted = diagonal + (a[i] != b[j]);
      diagonal = row[j + 1];
      row[j + 1] = std::min({substituted, row[j + 1] + 1, row[j] + 1});
    }
  }
  return row.back();
}

std::string_view nearest_name(std::string_view name, std::span<const std::string_view> candidates) {
  expect(!candidates.empty(), "there is a name to suggest");
  return *std::ranges::min_element(candidates, {},
                                   [&](std::string_view c) { return edit_distance(name, c); });
}

}  // namespace flamefield
