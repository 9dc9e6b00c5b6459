#include "services/dispatcher/cost_model.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace flamefield {

namespace {

constexpr std::size_t kKept = 9;

Cost summary_of(const std::deque<Cost>& costs) {
  std::vector<double> times;
  Cost out;
  for (const Cost& cost : costs) {
    times.push_back(cost.wall_s);
    out.peak_mib = std::max(out.peak_mib, cost.peak_mib);
  }
  const auto middle = times.begin() + static_cast<std::ptrdiff_t>(times.size() / 2);
  std::nth_element(times.begin(), middle, times.end());
  out.wall_s = *middle;
  return out;
}

}  // namespace

double work_of(const Grid& grid, std::size_t views) {
  return static_cast<double>(grid.nx) * grid.ny * grid.nz * static_cast<double>(views);
}

void CostModel::observe(const RunShape& shape, const Cost& cost) {
  std::deque<Cost>& costs = by_setup_[shape.setup];
  costs.push_back(cost);
  if (costs.size() > kKept) costs.pop_front();
  if (shape.work > 0) by_solver_[shape.solver][shape.work] = shape.setup;
}

Cost CostModel::estimate(const RunShape& shape) const {
  if (const auto same = by_setup_.find(shape.setup); same != by_setup_.end()) return summary_of(same->second);
  const auto sizes = by_solver_.find(shape.solver);
  if (sizes == by_solver_.end() || shape.work <= 0) return {};
  auto next = sizes->second.lower_bound(shape.work);
  if (next == sizes->second.end()) {
    --next;
  } else if (next != sizes->second.begin()) {
    const auto below = std::prev(next);
    if (shape.work / below->first < next->first / shape.work) next = below;
  }
  const double ratio = shape.work / next->first;
  const Cost known = summary_of(by_setup_.at(next->second));
  return {ratio * known.wall_s, std::max(1.0, ratio) * known.peak_mib};
}

}  // namespace flamefield
