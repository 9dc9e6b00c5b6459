#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

namespace flamefield {

// Views dealt out to subsets like cards, so that each looks from all around; subsets follow each other in an
// order in which neighbours differ most (Herman and Meyer, 1993: bit reversal; here golden-section steps).
inline std::vector<std::vector<std::size_t>> ordered_subsets(std::size_t views, int wanted) {
  const std::size_t count = std::clamp<std::size_t>(static_cast<std::size_t>(wanted), 1, views);
  std::vector<std::vector<std::size_t>> dealt(count), out;
  for (std::size_t v = 0; v < views; ++v) dealt[v % count].push_back(v);
  std::vector<bool> used(count, false);
  for (std::size_t k = 0; k < count; ++k) {
    auto next =
        static_cast<std::size_t>(static_cast<double>(k) * 0.6180339887 * static_cast<double>(count)) % count;
    while (used[next]) next = (next + 1) % count;
    used[next] = true;
    out.push_back(dealt[next]);
  }
  return out;
}

}  // namespace flamefield
