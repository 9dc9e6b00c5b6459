#include "services/study/findings.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "services/report/html.h"
#include "services/study/evolution.h"

namespace flamefield {

namespace {

using Rule = StudyFinding::Rule;
using Runs = std::vector<const FinishedRun*>;

struct Split {
  Runs favoured, others;
  std::string favoured_name, others_name;
};

std::string value_name(const StudyFinding& finding, const RunGroup& group) {
  return concat(spoken(finding.over), " ", group.name);
}

Split split_by_ends(const Runs& runs, const StudyFinding& finding) {
  std::vector<RunGroup> groups = groups_of(runs, finding.over);
  std::erase_if(groups, [](const RunGroup& g) { return !number_of(g.value); });
  if (groups.size() < 2) return {};
  const RunGroup &low = groups.front(), &high = groups.back();
  const bool falls = finding.rule == Rule::Falls;
  const RunGroup &good = falls ? low : high, &bad = falls ? high : low;
  return {good.runs, bad.runs, value_name(finding, good), value_name(finding, bad)};
}

// The threshold may be a setting of the run itself, e.g. its mutation rate, or a number.
Split split_above(const Runs& runs, const StudyFinding& finding) {
  Split split;
  std::string threshold;
  for (const FinishedRun* run : runs) {
    const auto value = number_of(value_of(run->run, finding.over));
    auto than = number_of(value_of(run->run, finding.than));
    if (!than) {
      char* end = nullptr;
      const double number = std::strtod(finding.than.c_str(), &end);
      if (end && *end == 0 && !finding.than.empty()) than = number;
    }
    if (!value || !than) continue;
    threshold = number(*than, 3);
    (*value > *than ? split.favoured : split.others).push_back(run);
  }
  split.favoured_name = concat(spoken(finding.over), " above ", threshold);
  split.others_name = concat(spoken(finding.over), " up to ", threshold);
  return split;
}

Split split_cases(const Runs& runs, const StudyFinding& finding) {
  Split split{{}, {}, finding.better, finding.than};
  for (const FinishedRun* run : runs) {
    if (run->run.case_name == finding.better) split.favoured.push_back(run);
    if (run->run.case_name == finding.than) split.others.push_back(run);
  }
  return split;
}

std::vector<double> values_of(const Runs& runs, const std::string& name) {
  std::vector<double> out;
  for (const FinishedRun* run : runs) out.push_back(measure(run->record, name));
  return out;
}

std::vector<double> ranks_of(const std::vector<double>& values) {
  std::vector<double> ranks(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    double below = 0, equal = 0;
    for (double v : values) below += v < values[i], equal += v == values[i];
    ranks[i] = below + (equal + 1) / 2;
  }
  return ranks;
}

// Spearman: Pearson's correlation of the ranks.
double rank_correlation(const std::vector<double>& x, const std::vector<double>& y) {
  const auto a = ranks_of(x), b = ranks_of(y);
  const auto n = static_cast<double>(a.size());
  const double ma = std::accumulate(a.begin(), a.end(), 0.0) / n,
               mb = std::accumulate(b.begin(), b.end(), 0.0) / n;
  double aa = 0, bb = 0, ab = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    aa += (a[i] - ma) * (a[i] - ma), bb += (b[i] - mb) * (b[i] - mb), ab += (a[i] - ma) * (b[i] - mb);
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : std::numeric_limits<double>::quiet_NaN();
}

double rank_over(const Runs& runs, const StudyFinding& finding, const std::string& name) {
  std::vector<double> x, y;
  for (const FinishedRun* run : runs)
    if (const auto value = number_of(value_of(run->run, finding.over)))
      x.push_back(*value), y.push_back(measure(run->record, name));
  return x.size() < 3 ? std::numeric_limits<double>::quiet_NaN() : rank_correlation(x, y);
}

// How much better a value could be: the distance to perfection.
double room(const std::string& name, double value) {
  return is_better_when_high(name) ? 1 - value : value;
}

// Of the mean of a group, from what only the seeds make: runs whose settings differ are no repeats.
double standard_error(const Runs& runs, const std::string& name) {
  std::map<std::string, std::vector<double>> cells;
  for (const FinishedRun* run : runs) {
    std::string settings = run->run.case_name;
    for (const auto& [key, value] : run->run.swept) settings += concat(',', text_of(value));
    cells[settings].push_back(measure(run->record, name));
  }
  double variance = 0;
  for (const auto& [settings, values] : cells)
    if (const Spread s = spread_of(values); s.count > 1)
      variance += s.sd * s.sd / static_cast<double>(s.count);
  return std::sqrt(variance) / static_cast<double>(std::max<std::size_t>(1, cells.size()));
}

MeasureComparison compare_groups(const Split& split, const StudyFinding& finding, const Runs& all,
                                 const std::string& name) {
  MeasureComparison c{.measure = name,
                      .favoured = spread_of(values_of(split.favoured, name)),
                      .others = spread_of(values_of(split.others, name)),
                      .rank = finding.rule == Rule::Cases ? std::numeric_limits<double>::quiet_NaN()
                                                          : rank_over(all, finding, name)};
  if (c.favoured.count == 0 || c.others.count == 0) return c;
  c.gain = (is_better_when_high(name) ? 1 : -1) * (c.favoured.mean - c.others.mean);
  c.error = std::hypot(standard_error(split.favoured, name), standard_error(split.others, name));
  const double least = std::max(2 * c.error, 1e-2 * room(name, c.others.mean));
  c.verdict = c.gain > least ? Outcome::Holds : c.gain < -least ? Outcome::Fails : Outcome::Unclear;
  return c;
}

Outcome whole_of(const std::vector<MeasureComparison>& comparisons) {
  std::size_t holds = 0, fails = 0, none = 0;
  for (const MeasureComparison& c : comparisons) {
    holds += c.verdict == Outcome::Holds;
    fails += c.verdict == Outcome::Fails;
    none += c.verdict == Outcome::NoData;
  }
  if (none > 0 || comparisons.empty()) return Outcome::NoData;
  if (holds == comparisons.size()) return Outcome::Holds;
  if (holds > 0) return Outcome::Partly;
  return fails > 0 ? Outcome::Fails : Outcome::Unclear;
}

}  // namespace

std::string_view name_of(Outcome verdict) {
  switch (verdict) {
    case Outcome::Holds:
      return "holds";
    case Outcome::Partly:
      return "holds in part";
    case Outcome::Fails:
      return "does not hold";
    case Outcome::Unclear:
      return "no clear difference";
    case Outcome::NoData:
      return "not run";
  }
  return "";
}

FindingResult judge(const StudyResults& results, const StudyFinding& finding) {
  FindingResult out{.finding = finding};
  const Runs runs = all_of(results);
  const Split split = finding.rule == Rule::Cases   ? split_cases(runs, finding)
                      : finding.rule == Rule::Above ? split_above(runs, finding)
                                                    : split_by_ends(runs, finding);
  out.favoured = split.favoured_name, out.others = split.others_name;
  for (const std::string& name : finding.measures)
    out.comparisons.push_back(compare_groups(split, finding, runs, name));
  out.verdict = whole_of(out.comparisons);
  if (out.verdict != Outcome::NoData)
    out.reasons = explain(split.favoured, split.others, {out.favoured, out.others}, finding);
  return out;
}

}  // namespace flamefield
