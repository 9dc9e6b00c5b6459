#include "reconstruct/sweeps.h"

#include <algorithm>
#include <cmath>

#include "reconstruct/filter.h"
#include "reconstruct/vectors.h"

namespace flamefield {

std::vector<SettingField> fields_of(SweepOptions& o, Subsets subsets) {
  std::vector<SettingField> fields = {
      {"max_iterations", "", 1, 1e6, "sweeps over all views; more sharpen the noise", &o.max_iterations},
      {"smoothing", "", 0, 1, "share of a 7-point filter after each sweep", &o.smoothing}};
  if (subsets == Subsets::Chosen)
    fields.push_back({"subsets", "", 1, 1000, "groups of views, each a correction", &o.subsets});
  return fields;
}

std::vector<std::vector<std::size_t>> ordered_subsets(std::size_t views, int wanted) {
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

namespace {

constexpr std::size_t kGrain = 8192;

// A_s^T 1 of every subset: kept when that is not too much, else made anew each time, for an adjoint more.
class ColumnSums {
 public:
  ColumnSums(const Problem& problem, std::span<const std::vector<std::size_t>> subsets)
      : problem_(problem),
        subsets_(subsets),
        ones_(even_images(problem.projector.layout())),
        sums_(problem.projector.layout().voxels()) {
    constexpr std::size_t kKeptVoxels = std::size_t{1} << 26;  // 256 MiB
    if (subsets.size() > 1 && subsets.size() * sums_.size() <= kKeptVoxels) kept_.resize(subsets.size());
    for (std::size_t s = 0; s < kept_.size(); ++s) {
      make(s);
      kept_[s] = sums_;
    }
    if (subsets.size() == 1) make(0);
  }
  std::span<const float> of(std::size_t subset) {
    if (!kept_.empty()) return kept_[subset];
    if (subsets_.size() > 1) make(subset);
    return sums_;
  }

 private:
  void make(std::size_t subset) { problem_.projector.adjoint(problem_.team, subsets_[subset], ones_, sums_); }
  const Problem& problem_;
  std::span<const std::vector<std::size_t>> subsets_;
  std::vector<float> ones_, sums_;
  std::vector<std::vector<float>> kept_;
};

// The problem's support without voxels that no ray meets.
std::vector<std::uint8_t> seen_support(const Problem& problem, ColumnSums& sums, std::size_t subsets) {
  std::vector<std::uint8_t> seen(problem.projector.layout().voxels(), 0);
  for (std::size_t s = 0; s < subsets; ++s) {
    const auto met = sums.of(s);
    for (std::size_t j = 0; j < seen.size(); ++j) seen[j] |= met[j] > kUnmet;
  }
  for (std::size_t j = 0; j < problem.support.size(); ++j) seen[j] &= problem.support[j] != 0;
  return seen;
}

}  // namespace

Solution sweep(const Problem& whole, const SweepOptions& options, std::vector<float> start,
               const SweepSteps& steps) {
  const Projector& projector = whole.projector;
  const Layout& layout = projector.layout();
  const auto subsets = ordered_subsets(projector.views(), options.subsets);
  ColumnSums sums(whole, subsets);
  const std::vector<std::uint8_t> seen = seen_support(whole, sums, subsets.size());
  Problem problem = whole;
  problem.support = seen;

  std::vector<float> images(layout.pixels()), back(layout.voxels());
  std::vector<double> squares(projector.views());
  const double norm = squared_norm(problem.team, problem.images);
  Monitor monitor(problem.control, options.max_iterations, problem.stop);
  Solution out;
  out.volume = std::move(start);
  constrain(problem, out.volume);
  for (int iteration = 1;; ++iteration) {
    for (std::size_t s = 0; s < subsets.size(); ++s) {
      projector.forward(problem.team, subsets[s], out.volume, images);
      problem.team.run(subsets[s].size(), [&](std::size_t i) {
        const std::size_t view = subsets[s][i], begin = view * layout.pixels_per_view();
        squares[view] = steps.compare(begin, begin + layout.pixels_per_view(), images);
      });
      projector.adjoint(problem.team, subsets[s], images, back);
      const auto column_sums = sums.of(s);
      problem.team.run_ranges(back.size(), kGrain, [&](std::size_t begin, std::size_t end) {
        steps.correct(begin, end, back, column_sums, out.volume);
      });
      constrain(problem, out.volume);
    }
    if (options.smoothing > 0) {
      smooth(out.volume, back, projector, options.smoothing, problem.team);
      constrain(problem, out.volume);
    }
    double square = 0;
    for (double s : squares) square += s;
    out.iterations = iteration;
    out.voxel_updates += static_cast<double>(back.size()) * static_cast<double>(subsets.size());
    if (const auto reason = monitor.after(iteration, norm > 0 ? std::sqrt(square / norm) : 0)) {
      out.stop_reason = *reason;
      break;
    }
  }
  out.history = monitor.history();
  return out;
}

std::vector<float> positive_start(const Problem& problem) {
  constexpr float kFaint = 1e-4f;  // of the even field
  const Layout& layout = problem.projector.layout();
  std::vector<float> x = even_volume(layout), images(layout.pixels());
  problem.projector.forward(problem.team, x, images);
  double sum_b = 0, sum_a = 0;
  for (std::size_t p = 0; p < images.size(); ++p) {
    sum_b += std::max(problem.images[p], 0.0f);
    sum_a += images[p];
  }
  const float level = sum_a > 0 ? static_cast<float>(sum_b / sum_a) : 0.0f;
  if (problem.start.empty()) {
    std::ranges::fill(x, level);
  } else {
    x = start_of(problem);
    for (float& v : x) v = std::max(v, kFaint * level);
  }
  return x;
}

}  // namespace flamefield
