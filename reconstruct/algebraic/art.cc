#include "reconstruct/algebraic/art.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "reconstruct/algebraic/row_table.h"
#include "reconstruct/filter.h"
#include "reconstruct/sweeps.h"

namespace flamefield {

std::vector<SettingField> art_fields(ArtOptions& o) {
  return {{"max_iterations", "", 1, 1e6, "sweeps over all rays; more sharpen the noise", &o.max_iterations},
          {"relaxation", "", 1e-6, 1.999, "step length", &o.relaxation},
          {"smoothing", "", 0, 1, "share of a 7-point filter after each sweep", &o.smoothing},
          {"memory_budget_mib", "MiB", 0, 1e9, "for the stored rays", &o.memory_budget_mib}};
}

std::vector<std::uint32_t> ray_order(std::size_t views, std::size_t pixels_per_view) {
  const auto order_of_views = ordered_subsets(views, static_cast<int>(views));
  auto stride = static_cast<std::size_t>(0.6180339887 * static_cast<double>(pixels_per_view)) + 1;
  while (std::gcd(stride, pixels_per_view) != 1) ++stride;
  std::vector<std::uint32_t> order;
  order.reserve(views * pixels_per_view);
  for (std::size_t k = 0; k < pixels_per_view; ++k)
    for (std::size_t v = 0; v < views; ++v) {
      const std::size_t view = order_of_views[v][0];
      // Views start at different places, so that rays of one round do not meet in one plane.
      const std::size_t pixel =
          (k + v * pixels_per_view / views) % pixels_per_view * stride % pixels_per_view;
      order.push_back(static_cast<std::uint32_t>(view * pixels_per_view + pixel));
    }
  return order;
}

namespace {

// |a_i|^2 of every row, none smaller than a share of the largest; 0 where nothing is met.
std::vector<float> row_norms(const RowTable& table) {
  std::vector<float> norms(table.rows(), 0);
  for (std::size_t pixel = 0; pixel < norms.size(); ++pixel)
    for (const RowTable::Entry& e : table.row(pixel)) norms[pixel] += e.weight * e.weight;
  const float least = kLeastShare * *std::ranges::max_element(norms);
  for (float& norm : norms) norm = norm > 0 ? std::max(norm, least) : 0;
  return norms;
}

// One sweep; returns the sum of (b - Ax)^2, each ray's before its own correction.
double sweep_rays(const RowTable& table, std::span<const float> norms, std::span<const std::uint32_t> order,
                  std::span<const float> b, float relaxation, float lowest, std::span<float> x) {
  double squares = 0;
  for (const std::uint32_t pixel : order) {
    const auto row = table.row(pixel);
    float ax = 0;
    for (const RowTable::Entry& e : row) ax += e.weight * x[e.voxel];
    const float d = b[pixel] - ax;
    squares += static_cast<double>(d) * d;
    if (!(norms[pixel] > 0)) continue;
    const float step = relaxation * d / norms[pixel];
    for (const RowTable::Entry& e : row) x[e.voxel] = std::max(lowest, x[e.voxel] + step * e.weight);
  }
  return squares;
}

}  // namespace

Result<Solution> solve_art(const Problem& problem, const ArtOptions& options) {
  const Projector& projector = problem.projector;
  const auto table = RowTable::make(projector, problem.support, options.memory_budget_mib, problem.team);
  if (!table) return tl::unexpected(table.error());
  const std::vector<float> b = projector.layout().unpack_images(problem.images);
  const std::vector<float> norms = row_norms(*table);
  const auto order = ray_order(projector.views(), b.size() / projector.views());
  const double norm = std::inner_product(b.begin(), b.end(), b.begin(), 0.0);

  Monitor monitor(problem.control, options.max_iterations, problem.stop);
  Solution out;
  out.volume = start_of(problem);
  std::vector<float> scratch(out.volume.size());
  const float lowest = problem.non_negative ? 0.0f : -INFINITY;
  for (int iteration = 1;; ++iteration) {
    const double squares =
        sweep_rays(*table, norms, order, b, static_cast<float>(options.relaxation), lowest, out.volume);
    if (options.smoothing > 0) {
      smooth(out.volume, scratch, projector.layout(), options.smoothing, problem.team);
      constrain(problem, out.volume);
    }
    out.iterations = iteration;
    out.voxel_updates += static_cast<double>(table->entries());
    if (const auto reason = monitor.after(iteration, norm > 0 ? std::sqrt(squares / norm) : 0)) {
      out.stop_reason = *reason;
      break;
    }
  }
  out.history = monitor.history();
  return out;
}

}  // namespace flamefield
