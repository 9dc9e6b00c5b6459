#include "reconstruct/statistical/map.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "reconstruct/filter.h"
#include "reconstruct/random.h"
#include "reconstruct/vectors.h"

namespace flamefield {

std::vector<SettingField> map_fields(MapOptions& o) {
  std::vector<SettingField> fields = fields_of(o.quadratic);
  static constexpr std::string_view kSigmas[] = {"noise", "posterior"};
  fields.push_back({"sigma", "", 0, 0,
                    "of the sigma volume: scatter under noise, or with the prior's freedom",
                    choice_of(o.sigma, kSigmas)});
  fields.push_back({"draws", "", 0, 10000, "for the sigma volume; 0: none", &o.draws});
  return fields;
}

namespace {

constexpr std::size_t kGrain = 8192;

// 1 / variance
std::vector<float> pixel_weights_of(const Problem& problem, const NoiseModel& noise) {
  std::vector<float> weights(problem.images.size());
  for (std::size_t p = 0; p < weights.size(); ++p)
    weights[p] = static_cast<float>(1 / (noise.variance(problem.images[p]) + kLeastNoise * kLeastNoise));
  return weights;
}

// One set of images as the cameras might have seen the field behind `clean`.
std::vector<float> disturbed(const Problem& problem, std::span<const float> clean, const NoiseModel& noise,
                             int draw) {
  const Layout& l = problem.projector.layout();
  std::vector<float> out(clean.begin(), clean.end());
  problem.team.run(problem.projector.views(), [&](std::size_t view) {
    Stream stream(problem.control.seed, static_cast<std::uint64_t>(draw) * problem.projector.views() + view);
    for (int col = 0; col < l.cols; ++col)
      for (int row = 0; row < l.rows; ++row) {
        float& value = out[l.pixel(static_cast<int>(view), row, col)];
        value += static_cast<float>(std::sqrt(noise.variance(value)) * stream.normal());
      }
  });
  return out;
}

}  // namespace

Solution solve_map(const Problem& problem, const MapOptions& options) {
  const NoiseModel noise = noise_of(problem);
  const std::vector<float> weights = pixel_weights_of(problem, noise);
  Monitor monitor(problem.control, options.quadratic.max_iterations, problem.stop);
  QuadraticSolution found = solve_quadratic(problem, options.quadratic, weights, monitor);
  Solution& out = found.solution;
  if (options.draws == 0) return out;

  std::vector<std::size_t> views(problem.projector.views());
  std::iota(views.begin(), views.end(), std::size_t{0});
  Quadratic q{problem, weights, views, options.quadratic.order, 0, normal_scale(problem, weights)};
  q.penalty = found.weight * q.scale;
  std::vector<float> clean(problem.images.size()), sum(out.volume.size(), 0), squares(sum.size(), 0);
  problem.projector.forward(problem.team, out.volume, clean);
  int draws = 0;
  for (; draws < options.draws && !monitor.interrupted(); ++draws) {
    std::vector<float> x = out.volume, pull;
    if (options.sigma == MapSigma::Posterior) pull = random_pull(q, draws);
    q.pull = pull;
    minimise(q, disturbed(problem, clean, noise, draws), options.quadratic.max_iterations,
             options.quadratic.tolerance, monitor, Report::Nothing, x);
    problem.team.run_ranges(x.size(), kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t j = begin; j < end; ++j) {
        const float d = x[j] - out.volume[j];
        sum[j] += d;
        squares[j] += d * d;
      }
    });
  }
  if (draws < options.draws) out.stop_reason = monitor.interrupted().value_or(out.stop_reason);
  if (draws < 2) return out;
  const auto n = static_cast<float>(draws);
  for (std::size_t j = 0; j < sum.size(); ++j)
    squares[j] = std::max(0.0f, squares[j] - sum[j] * sum[j] / n) / (n - 1);
  // Neighbours scatter alike: their mean is worth more draws.
  smooth(squares, sum, problem.projector.layout(), 1, problem.team);
  for (float& s : squares) s = std::sqrt(s);
  out.sigma = std::move(squares);
  return out;
}

}  // namespace flamefield
