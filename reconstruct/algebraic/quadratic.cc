#include "reconstruct/algebraic/quadratic.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numeric>

#include "reconstruct/random.h"
#include "reconstruct/vectors.h"

namespace flamefield {

std::vector<SettingField> fields_of(QuadraticOptions& o) {
  return {
      {"order", "", 0, 1, "penalty: 0 the field itself, 1 its gradient", &o.order},
      {"weight_rule", "", 0, 0, "how the weight of the penalty is found", weight_rule_choice(o.weight_rule)},
      {"weight", "", 1e-12, 1e6, "of the penalty, with weight_rule = \"fixed\"", &o.weight},
      {"max_iterations", "", 1, 1e6, "iterations", &o.max_iterations},
      {"tolerance", "", 0, 1, "stop when the field changes less, relative", &o.tolerance}};
}

namespace {

constexpr std::size_t kGrain = 8192;

void multiply(Team& team, std::span<const float> factors, std::span<float> values) {
  if (factors.empty()) return;
  team.run_ranges(values.size(), kGrain, [&](std::size_t begin, std::size_t end) {
    for (std::size_t p = begin; p < end; ++p) values[p] *= factors[p];
  });
}

void keep_support(const Problem& problem, std::span<float> x) {
  if (problem.support.empty()) return;
  for (std::size_t j = 0; j < x.size(); ++j)
    if (!problem.support[j]) x[j] = 0;
}

// out = L^T L x; the gradient ends flat at the faces of the box. Differences are per smallest voxel side.
void apply_penalty(const Quadratic& q, std::span<const float> x, std::span<float> out) {
  if (q.order == 0) {
    std::ranges::copy(x, out.begin());
    return;
  }
  const Layout& l = q.problem.projector.layout();
  const Eigen::Vector3d side = q.problem.projector.grid().spacing_mm;
  const Eigen::Vector3f share = (side.minCoeff() / side.array()).square().cast<float>();
  const auto ny = static_cast<std::size_t>(l.ny);
  q.problem.team.run(static_cast<std::size_t>(l.nz), [&](std::size_t slab) {
    const int k = static_cast<int>(slab);
    for (int i = 0; i < l.nx; ++i) {
      const auto column = [&](int cx, int cz) {
        return x.data() + l.voxel(std::clamp(cx, 0, l.nx - 1), 0, std::clamp(cz, 0, l.nz - 1));
      };
      const float *v = column(i, k), *left = column(i - 1, k), *right = column(i + 1, k),
                  *front = column(i, k - 1), *rear = column(i, k + 1);
      float* to = out.data() + l.voxel(i, 0, k);
      for (std::size_t y = 0; y < ny; ++y) {
        const float below = v[y > 0 ? y - 1 : y], above = v[y + 1 < ny ? y + 1 : y];
        to[y] = share.x() * (2 * v[y] - left[y] - right[y]) + share.y() * (2 * v[y] - below - above) +
                share.z() * (2 * v[y] - front[y] - rear[y]);
      }
      std::fill(to + ny, to + l.column, 0.0f);
    }
  });
}

// Ax of the views that count; others stay as they are.
void forward(const Quadratic& q, std::span<const float> x, std::span<float> ax) {
  q.problem.projector.forward(q.problem.team, q.views, x, ax);
}

// A^T W y + penalty L^T L x. `weighted` is scratch.
void gradient_of(const Quadratic& q, std::span<const float> y, std::span<const float> x,
                 std::span<float> weighted, std::span<float> scratch, std::span<float> out) {
  std::ranges::copy(y, weighted.begin());
  multiply(q.problem.team, q.pixel_weights, weighted);
  q.problem.projector.adjoint(q.problem.team, q.views, weighted, out);
  if (q.penalty > 0) {
    apply_penalty(q, x, scratch);
    add_scaled(q.problem.team, q.penalty, scratch, out);
  }
  keep_support(q.problem, out);
}

// sum w_i r_i^2 over the views that count
double weighted_squares(const Quadratic& q, std::span<const float> r, std::span<const std::size_t> views) {
  const std::size_t pixels = q.problem.projector.layout().pixels_per_view();
  std::vector<double> sums(views.size(), 0);
  q.problem.team.run(views.size(), [&](std::size_t i) {
    for (std::size_t p = views[i] * pixels; p < (views[i] + 1) * pixels; ++p)
      sums[i] += (q.pixel_weights.empty() ? 1.0 : static_cast<double>(q.pixel_weights[p])) * r[p] * r[p];
  });
  return std::accumulate(sums.begin(), sums.end(), 0.0);
}

}  // namespace

double normal_scale(const Problem& problem, std::span<const float> pixel_weights) {
  const Layout& layout = problem.projector.layout();
  std::vector<float> x = even_volume(layout), images(layout.pixels());
  problem.projector.forward(problem.team, x, images);
  multiply(problem.team, pixel_weights, images);
  problem.projector.adjoint(problem.team, images, x);
  const auto voxels = static_cast<double>(problem.projector.share().whole().voxels());
  return std::sqrt(squared_norm(problem.projector, problem.team, x) / voxels);
}

std::vector<float> random_pull(const Quadratic& q, int draw) {
  const Layout& l = q.problem.projector.layout();
  const Eigen::Vector3d side = q.problem.projector.grid().spacing_mm;
  const Eigen::Vector3d share = side.minCoeff() / side.array();
  std::vector<float> out(l.voxels(), 0.0f);
  Stream stream(q.problem.control.seed, (std::uint64_t{1} << 60) | static_cast<std::uint64_t>(draw));
  const auto pull = [&](double size) {
    return static_cast<float>(std::sqrt(q.penalty) * size * stream.normal());
  };
  for (int z = 0; z < l.nz; ++z)
    for (int x = 0; x < l.nx; ++x)
      for (int y = 0; y < l.ny; ++y) {
        float& here = out[l.voxel(x, y, z)];
        const auto against = [&](bool inside, float& next, double size) {
          if (!inside) return;
          const float both = pull(size);
          next += both;
          here -= both;
        };
        if (q.order == 0) {
          here = pull(1);
        } else {
          against(x + 1 < l.nx, out[l.voxel(std::min(x + 1, l.nx - 1), y, z)], share.x());
          against(y + 1 < l.ny, out[l.voxel(x, std::min(y + 1, l.ny - 1), z)], share.y());
          against(z + 1 < l.nz, out[l.voxel(x, y, std::min(z + 1, l.nz - 1))], share.z());
        }
      }
  return out;
}

double roughness(const Quadratic& q, std::span<const float> x) {
  std::vector<float> out(x.size());
  apply_penalty(q, x, out);
  return std::max(0.0, dot(q.problem.team, x, out));
}

QuadraticEnd minimise(const Quadratic& q, std::span<const float> images, int max_iterations, double tolerance,
                      Monitor& monitor, Report report, std::vector<float>& x) {
  Team& team = q.problem.team;
  std::vector<float> r(images.size(), 0), ad(images.size(), 0), weighted(images.size()), g(x.size()),
      d(x.size()), hd(x.size()), scratch(x.size());
  const double norm_b = std::sqrt(squared_norm(team, images));
  const double hessian = q.scale + (q.order == 0 ? 1 : 12) * q.penalty;
  // r = A x - b
  const auto renew = [&] {
    forward(q, x, r);
    add_scaled(team, -1, images, r);
    gradient_of(q, r, x, weighted, scratch, g);
    if (q.pull.empty()) return;
    add_scaled(team, -1, q.pull, g);
    keep_support(q.problem, g);
  };
  constrain(q.problem, x);
  renew();
  QuadraticEnd end;
  double fall = 0;  // J - J(start)
  std::deque<double> recent = {0};
  double step = hessian > 0 ? 1 / hessian : 0;
  constexpr std::size_t kMemory = 10;  // of the non-monotone line search
  constexpr int kRenew = 50;           // iterations between exact gradients
  for (int iteration = 1; iteration <= max_iterations; ++iteration) {
    team.run_ranges(x.size(), kGrain, [&](std::size_t begin, std::size_t finish) {
      for (std::size_t j = begin; j < finish; ++j) d[j] = x[j] - static_cast<float>(step) * g[j];
    });
    constrain(q.problem, d);
    add_scaled(team, -1, x, d);
    forward(q, d, ad);
    gradient_of(q, ad, d, weighted, scratch, hd);
    const double gd = dot(team, g, d), dhd = dot(team, d, hd), dd = squared_norm(team, d);
    double length = 1;
    if (fall + gd + 0.5 * dhd > *std::ranges::max_element(recent) + 1e-4 * gd && dhd > 0)
      length = std::min(1.0, -gd / dhd);
    add_scaled(team, length, d, x);
    add_scaled(team, length, ad, r);
    add_scaled(team, length, hd, g);
    fall += length * gd + 0.5 * length * length * dhd;
    recent.push_back(fall);
    if (recent.size() > kMemory) recent.pop_front();
    // How far a plain gradient step would go, judged by this one.
    const double change = step > 0 ? std::sqrt(dd) / (step * hessian) : 0;
    end.iterations = iteration;
    if (dhd > 0) step = std::clamp(dd / dhd, 1e-3 / hessian, 1e6 / hessian);
    if (iteration % kRenew == 0) renew();
    const double size = std::sqrt(squared_norm(team, x));
    std::optional<StopReason> reason = monitor.interrupted();
    if (report == Report::Iterations)
      reason = monitor.after(iteration, norm_b > 0 ? std::sqrt(squared_norm(team, r)) / norm_b : 0);
    if (reason) {
      end.reason = *reason;
      break;
    }
    if (change <= tolerance * size || !(dd > 0)) break;
  }
  end.misfit = std::sqrt(weighted_squares(q, r, q.views));
  return end;
}

namespace {

// Leaves the field of the last trial in x.
double find_weight(Quadratic q, const QuadraticOptions& options, Monitor& monitor, std::vector<float>& x) {
  constexpr double kHighest = 0.1, kLowest = 1e-5;
  const Problem& problem = q.problem;
  const Layout& layout = problem.projector.layout();
  const std::size_t views = problem.projector.views();
  std::vector<std::size_t> all(views);
  std::iota(all.begin(), all.end(), std::size_t{0});
  const HeldOutViews split =
      options.weight_rule == WeightRule::HeldOut && views > 1 ? held_out_views(views) : HeldOutViews{all, {}};
  q.views = split.used;
  const NoiseModel noise = noise_of(problem);
  double variance = 0;
  for (int v = 0; v < layout.views; ++v)
    for (int col = 0; col < layout.cols; ++col)
      for (int row = 0; row < layout.rows; ++row) {
        const std::size_t p = layout.pixel(v, row, col);
        const double w = q.pixel_weights.empty() ? 1 : q.pixel_weights[p];
        variance += w * (noise.variance(problem.images[p]) + kLeastNoise * kLeastNoise);
      }

  std::vector<float> images(layout.pixels());
  return choose_weight(options.weight_rule, kHighest, kLowest, std::sqrt(variance), [&](double weight) {
    q.penalty = weight * q.scale;
    const QuadraticEnd end = minimise(q, problem.images, options.max_iterations / 2 + 1,
                                      3 * options.tolerance, monitor, Report::Nothing, x);
    WeightTrial trial{end.misfit, std::sqrt(roughness(q, x)), 0};
    if (!split.kept_back.empty()) {
      problem.projector.forward(problem.team, split.kept_back, x, images);
      for (std::size_t p = 0; p < images.size(); ++p) images[p] -= problem.images[p];
      trial.held_out = std::sqrt(weighted_squares(q, images, split.kept_back));
    }
    return trial;
  });
}

}  // namespace

QuadraticSolution solve_quadratic(const Problem& problem, const QuadraticOptions& options,
                                  std::span<const float> pixel_weights, Monitor& monitor) {
  std::vector<std::size_t> views(problem.projector.views());
  std::iota(views.begin(), views.end(), std::size_t{0});
  Quadratic q{problem, pixel_weights, views, options.order, 0, normal_scale(problem, pixel_weights)};
  QuadraticSolution out;
  Solution& solution = out.solution;
  solution.volume = start_of(problem);
  out.weight = options.weight;
  if (options.weight_rule != WeightRule::Fixed) {
    out.weight = find_weight(q, options, monitor, solution.volume);
    solution.notes.push_back(concat("weight ", out.weight, " by rule ", name_of(options.weight_rule)));
  }
  q.penalty = out.weight * q.scale;
  const QuadraticEnd end = minimise(q, problem.images, options.max_iterations, options.tolerance, monitor,
                                    Report::Iterations, solution.volume);
  solution.iterations = end.iterations;
  solution.stop_reason = end.reason;
  solution.voxel_updates = static_cast<double>(end.iterations) * static_cast<double>(solution.volume.size());
  solution.history = monitor.history();
  return out;
}

}  // namespace flamefield
