#include "reconstruct/variational/whiteness.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace flamefield {

ResidualSize residual_size(std::span<const float> a, std::span<const float> b, const Layout& layout,
                           Team& team) {
  const auto rows = static_cast<std::size_t>(layout.rows), cols = static_cast<std::size_t>(layout.cols),
             views = static_cast<std::size_t>(layout.views);
  std::vector<double> squares(views, 0), fine(views, 0);
  team.run(views, [&](std::size_t view) {
    std::vector<float> lines(cols * rows);
    for (std::size_t c = 0; c < cols; ++c) {
      const std::size_t from = view * layout.pixels_per_view() + c * layout.line;
      for (std::size_t r = 0; r < rows; ++r) {
        const float d = a[from + r] - b[from + r];
        lines[c * rows + r] = d;
        squares[view] += static_cast<double>(d) * static_cast<double>(d);
      }
    }
    for (std::size_t c = 1; c + 1 < cols; ++c) {
      const float *left = &lines[(c - 1) * rows], *at = left + rows, *right = at + rows;
      for (std::size_t r = 1; r + 1 < rows; ++r) {
        const auto across = [&](std::size_t i) { return left[i] - 2 * at[i] + right[i]; };
        const double d = static_cast<double>(across(r - 1) - 2 * across(r) + across(r + 1));
        fine[view] += d * d;
      }
    }
  });
  double square_sum = 0, fine_sum = 0;
  for (std::size_t v = 0; v < views; ++v) {
    square_sum += squares[v];
    fine_sum += fine[v];
  }
  const auto count = static_cast<double>(views);
  ResidualSize out;
  out.rms = std::sqrt(square_sum / (count * static_cast<double>(rows * cols)));
  // The nine coefficients' squares sum to 36.
  if (rows > 2 && cols > 2)
    out.fine_rms = std::sqrt(fine_sum / (36 * count * static_cast<double>((rows - 2) * (cols - 2))));
  return out;
}

}  // namespace flamefield
