#include "services/study/evolution.h"

#include <algorithm>
#include <cmath>

#include "services/report/html.h"

namespace flamefield {

namespace {

using Runs = std::vector<const FinishedRun*>;

double value_at(const std::vector<HistoryPoint>& history, double generation) {
  const auto after = std::ranges::lower_bound(
      history, generation, {}, [](const HistoryPoint& p) { return static_cast<double>(p.iteration); });
  if (after == history.end()) return history.back().fitness;
  if (after == history.begin()) return after->fitness;
  const HistoryPoint &a = *std::prev(after), &b = *after;
  const double t = (generation - a.iteration) / std::max(1, b.iteration - a.iteration);
  return a.fitness + t * (b.fitness - a.fitness);
}

double value_at(const FitnessPath& path, double generation) {
  const auto after = std::ranges::lower_bound(path.generation, generation);
  const auto i = static_cast<std::size_t>(after - path.generation.begin());
  if (i == path.generation.size()) return path.fitness.back();
  if (i == 0) return path.fitness.front();
  const double t = (generation - path.generation[i - 1]) / (path.generation[i] - path.generation[i - 1]);
  return path.fitness[i - 1] + t * (path.fitness[i] - path.fitness[i - 1]);
}

// Share of the remaining distance to 1 that was won over the last tenth.
double late_gain(const FitnessPath& path) {
  const double end = path.generation.back();
  const double before = value_at(path, 0.9 * end), now = path.fitness.back();
  return before < 1 ? (now - before) / (1 - before) : 0;
}

// The last generation at which the other one led; 0 when it never did.
double crossing(const FitnessPath& leader, const FitnessPath& other) {
  double at = 0;
  const double end = std::min(leader.generation.back(), other.generation.back());
  for (double g : leader.generation)
    if (g <= end && value_at(other, g) > value_at(leader, g)) at = g;
  return at;
}

double mean_measure(const Runs& runs, std::string_view name) {
  std::vector<double> values;
  for (const FinishedRun* run : runs) values.push_back(measure(run->record, name));
  return spread_of(values).mean;
}

std::string percent(double share) {
  return concat(number(100 * share, 2), " %");
}

void explain_order(const FitnessPath& good, const FitnessPath& bad, const std::array<std::string, 2>& names,
                   std::vector<std::string>& out) {
  const bool leads = good.fitness.back() > bad.fitness.back();
  const FitnessPath &first = leads ? good : bad, &second = leads ? bad : good;
  const std::string &winner = names[leads ? 0 : 1], &loser = names[leads ? 1 : 0];
  const double at = crossing(first, second), end = first.generation.back();
  if (at > 0 && at < end) {
    out.push_back(concat("'", loser, "' leads at first; '", winner, "' overtakes it after ", number(at, 3),
                         " of ", number(end, 3), " generations."));
  } else {
    out.push_back(concat("'", winner, "' leads throughout."));
  }
  const double a = late_gain(good), b = late_gain(bad);
  if (!leads && a > 1.25 * b && a > 0.01)
    out.push_back(concat("Over the last tenth of its generations '", names[0], "' still won ", percent(a),
                         " of the distance to a perfect fitness, the other ", percent(b),
                         ": the former would need more generations to show its worth."));
  else if (std::max(a, b) > 0.05)
    out.push_back(concat("Neither had settled: the last tenth of the generations still won ", percent(a),
                         " and ", percent(b), " of the distance to a perfect fitness."));
}

void explain_field(const Runs& good, const Runs& bad, std::vector<std::string>& out) {
  const double fitness = mean_measure(good, "fitness") - mean_measure(bad, "fitness");
  const double pearson_good = mean_measure(good, "pearson"), pearson_bad = mean_measure(bad, "pearson");
  if (!std::isfinite(pearson_good) || !std::isfinite(pearson_bad)) return;
  const std::string figures =
      concat("correlation ", number(pearson_good, 4), " against ", number(pearson_bad, 4));
  if ((fitness > 0) == (pearson_good > pearson_bad))
    out.push_back(concat("The field follows its images: ", figures, "."));
  else
    out.push_back(concat("The field does not follow its images (", figures,
                         "): what the cameras cannot see was filled at random."));
}

void explain_step(const Runs& good, const FitnessPath& path, const FitnessPath& other,
                  const StudyFinding& finding, std::vector<std::string>& out) {
  const auto at = number_of(value_of(good.front()->run, finding.step_at));
  const double end = path.generation.back(), window = 0.1 * end;
  if (!at || !(*at > window) || !(*at + window < end)) return;
  const auto gains = [&](const FitnessPath& p) {
    return std::array{value_at(p, *at) - value_at(p, *at - window),
                      value_at(p, *at + window) - value_at(p, *at)};
  };
  const auto with = gains(path), without = gains(other);
  out.push_back(concat("In the tenth of the generations before ", number(*at, 3), " the fitness rose by ",
                       number(with[0], 3), ", in the tenth after it by ", number(with[1], 3),
                       " (without: ", number(without[0], 3), " and ", number(without[1], 3), ")."));
}

}  // namespace

FitnessPath mean_path(const Runs& runs) {
  FitnessPath path;
  const FinishedRun* longest = nullptr;
  std::vector<const FinishedRun*> with_history;
  for (const FinishedRun* run : runs) {
    if (run->record.history.empty() || !(run->record.history.back().fitness > 0)) continue;
    with_history.push_back(run);
    if (!longest || run->record.history.size() > longest->record.history.size()) longest = run;
  }
  if (!longest) return path;
  for (const HistoryPoint& p : longest->record.history) {
    double sum = 0;
    for (const FinishedRun* run : with_history) sum += value_at(run->record.history, p.iteration);
    path.generation.push_back(p.iteration);
    path.fitness.push_back(sum / static_cast<double>(with_history.size()));
  }
  return path;
}

std::vector<std::string> explain(const Runs& favoured, const Runs& others,
                                 const std::array<std::string, 2>& names, const StudyFinding& finding) {
  std::vector<std::string> out;
  const FitnessPath good = mean_path(favoured), bad = mean_path(others);
  if (good.generation.size() > 1 && bad.generation.size() > 1) {
    explain_order(good, bad, names, out);
    if (!finding.step_at.empty()) explain_step(favoured, good, bad, finding, out);
  }
  explain_field(favoured, others, out);
  return out;
}

}  // namespace flamefield
