#include "reconstruct/weight.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

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

// Where the values are least: vertex of the parabola through the least one and its neighbours.
double vertex(std::span<const double> at, std::span<const double> values) {
  const auto best = static_cast<std::size_t>(std::ranges::min_element(values) - values.begin());
  if (best == 0 || best + 1 == values.size()) return at[best];
  const double bend = values[best - 1] - 2 * values[best] + values[best + 1];
  const double shift = bend > 0 ? 0.5 * (values[best - 1] - values[best + 1]) / bend : 0;
  return at[best] + shift * (at[best + 1] - at[best]);
}

double at_least_held_out(const Walk& walk) {
  std::vector<double> errors;
  for (const WeightTrial& trial : walk.trials) errors.push_back(trial.held_out);
  return vertex(walk.log_weight, errors);
}

// The trial farthest below the chord from the first to the last, and its neighbours: vertex of a parabola.
double at_corner(const Walk& walk) {
  constexpr double kTiny = 1e-30;
  const std::size_t n = walk.trials.size();
  const auto x = [&](std::size_t i) { return std::log(std::max(walk.trials[i].misfit, kTiny)); };
  const auto y = [&](std::size_t i) { return std::log(std::max(walk.trials[i].penalty, kTiny)); };
  const auto height = [&](std::size_t i) {
    return (x(n - 1) - x(0)) * (y(i) - y(0)) - (y(n - 1) - y(0)) * (x(i) - x(0));
  };
  // Weights fall: the curve runs to the left and up, and the corner lies to the lower left of the chord.
  std::vector<double> heights;
  for (std::size_t i = 0; i < n; ++i) heights.push_back(-height(i));
  return vertex(walk.log_weight, heights);
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
