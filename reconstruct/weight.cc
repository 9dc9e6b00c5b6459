#include "reconstruct/weight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "proto/check.h"

namespace flamefield {

namespace {
constexpr std::array<std::string_view, 4> kRuleNames = {"fixed", "discrepancy", "held-out", "l-curve"};
}

Choice weight_rule_choice(WeightRule& rule) {
  return choice_of(rule, kRuleNames);
}
std::string_view name_of(WeightRule rule) {
  return kRuleNames[static_cast<std::size_t>(rule)];
}

HeldOutViews held_out_views(std::size_t views) {
  HeldOutViews out;
  for (std::size_t v = 0; v < views; ++v) (v % 5 == 2 ? out.kept_back : out.used).push_back(v);
  if (out.kept_back.empty() && views > 1) {
    out.kept_back.push_back(out.used.back());
    out.used.pop_back();
  }
  return out;
}

namespace {

struct Walk {
  std::vector<double> log_weight;
  std::vector<WeightTrial> trials;
};

// Where log misfit meets log noise between the last two trials.
double at_discrepancy(const Walk& walk, double noise) {
  const std::size_t n = walk.trials.size();
  if (n < 2 || walk.trials[n - 1].misfit > noise) return walk.log_weight.back();
  const double above = std::log(walk.trials[n - 2].misfit), below = std::log(walk.trials[n - 1].misfit);
  const double t = above > below ? (above - std::log(noise)) / (above - below) : 1;
  return std::lerp(walk.log_weight[n - 2], walk.log_weight[n - 1], std::clamp(t, 0.0, 1.0));
}

// Vertex of the parabola through the best trial and its neighbours.
double at_least_held_out(const Walk& walk) {
  const auto best = static_cast<std::size_t>(
      std::ranges::min_element(walk.trials, {}, &WeightTrial::held_out) - walk.trials.begin());
  if (best == 0 || best + 1 == walk.trials.size()) return walk.log_weight[best];
  const double a = walk.trials[best - 1].held_out, b = walk.trials[best].held_out,
               c = walk.trials[best + 1].held_out;
  const double bend = a - 2 * b + c, shift = bend > 0 ? 0.5 * (a - c) / bend : 0;
  return walk.log_weight[best] + shift * (walk.log_weight[best + 1] - walk.log_weight[best]);
}

// The trial at which the curve turns most sharply: curvature of the circle through it and its neighbours.
double at_corner(const Walk& walk) {
  const auto point = [&](std::size_t i) {
    constexpr double kTiny = 1e-30;
    return std::array<double, 2>{std::log(std::max(walk.trials[i].misfit, kTiny)),
                                 std::log(std::max(walk.trials[i].penalty, kTiny))};
  };
  double sharpest = -INFINITY, found = walk.log_weight.back();
  for (std::size_t i = 1; i + 1 < walk.trials.size(); ++i) {
    const auto p = point(i - 1), q = point(i), r = point(i + 1);
    const double ax = q[0] - p[0], ay = q[1] - p[1], bx = r[0] - q[0], by = r[1] - q[1];
    const double sides = std::hypot(ax, ay) * std::hypot(bx, by) * std::hypot(ax + bx, ay + by);
    // Falling weights run to the left and up; the corner turns to the right.
    const double curvature = sides > 0 ? 2 * (ay * bx - ax * by) / sides : 0;
    if (curvature > sharpest) {
      sharpest = curvature;
      found = walk.log_weight[i];
    }
  }
  return found;
}

}  // namespace

double choose_weight(WeightRule rule, double highest, double lowest, double noise,
                     const std::function<WeightTrial(double weight)>& solve) {
  expect(rule != WeightRule::Fixed && lowest > 0 && highest >= lowest, "there is a range to choose from");
  Walk walk;
  const double step = 0.5 * std::log(10.0);
  for (double at = std::log(highest); at > std::log(lowest) - 0.01; at -= step) {
    walk.log_weight.push_back(at);
    walk.trials.push_back(solve(std::exp(at)));
    const auto& trials = walk.trials;
    const std::size_t n = trials.size();
    if (rule == WeightRule::Discrepancy && trials.back().misfit <= noise) break;
    // The minimum lies behind once the prediction has got worse twice.
    if (rule == WeightRule::HeldOut && n > 2 && trials[n - 1].held_out > trials[n - 2].held_out &&
        trials[n - 2].held_out > trials[n - 3].held_out)
      break;
  }
  if (rule == WeightRule::Discrepancy) return std::exp(at_discrepancy(walk, noise));
  return std::exp(rule == WeightRule::HeldOut ? at_least_held_out(walk) : at_corner(walk));
}

}  // namespace flamefield
