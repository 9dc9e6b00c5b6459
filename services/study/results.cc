#include "services/study/results.h"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace flamefield {

double measure(const RunRecord& record, std::string_view name) {
  if (name == "pearson") return record.metrics.pearson;
  if (name == "sqmd_3d") return record.metrics.sqmd;
  if (name == "sqmd_2d") return record.sqmd_2d;
  if (name == "ssim") return record.metrics.ssim;
  if (name == "wall_s") return record.wall_s;
  const bool evolved = !record.history.empty() && record.history.back().fitness > 0;
  return evolved ? record.history.back().fitness : record.fitness;
}

bool is_better_when_high(std::string_view name) {
  return name == "fitness" || name == "pearson" || name == "ssim";
}

std::string_view symbol_of(std::string_view name) {
  if (name == "pearson") return "Pearson correlation, 3D (1)";
  if (name == "sqmd_3d") return "SqMD, 3D (1)";
  if (name == "sqmd_2d") return "mean SqMD, 2D (1)";
  if (name == "fitness") return "final fitness 1 − Z (1)";
  return name;
}

Spread spread_of(const std::vector<double>& values) {
  Spread out;
  double sum = 0;
  for (double v : values)
    if (std::isfinite(v)) sum += v, ++out.count;
  if (out.count == 0) return out;
  out.mean = sum / static_cast<double>(out.count);
  if (out.count < 2) return out;
  double squares = 0;
  for (double v : values)
    if (std::isfinite(v)) squares += (v - out.mean) * (v - out.mean);
  out.sd = std::sqrt(squares / static_cast<double>(out.count - 1));
  return out;
}

std::string text_of(const Spread& spread, int digits) {
  if (spread.count == 0) return "–";
  std::ostringstream out;
  out << std::fixed << std::setprecision(digits) << spread.mean;
  // Solvers without chance repeat themselves exactly.
  if (spread.count > 1 && spread.sd >= 0.5 * std::pow(10.0, -digits)) out << " ± " << spread.sd;
  return out.str();
}

Setting value_of(const StudyRun& run, std::string_view over) {
  if (over == "case") return run.case_name;
  const auto found = run.flat.find(over);
  return found == run.flat.end() ? Setting(std::string()) : found->second;
}

std::string name_of_value(const StudyRun& run, std::string_view over) {
  if (over == "phantom.kind" || over == "phantom.field") return phantom_name(run.settings);
  return text_of(value_of(run, over));
}

std::vector<RunGroup> groups_of(const std::vector<const FinishedRun*>& runs, std::string_view over) {
  std::vector<RunGroup> groups;
  for (const FinishedRun* run : runs) {
    const std::string name = name_of_value(run->run, over);
    auto group = std::ranges::find(groups, name, &RunGroup::name);
    if (group == groups.end())
      group = groups.insert(groups.end(), RunGroup{name, value_of(run->run, over), {}});
    group->runs.push_back(run);
  }
  std::ranges::stable_sort(groups, [](const RunGroup& a, const RunGroup& b) {
    const auto x = number_of(a.value), y = number_of(b.value);
    return x && y && *x < *y;
  });
  return groups;
}

std::vector<const FinishedRun*> all_of(const StudyResults& results) {
  std::vector<const FinishedRun*> out;
  for (const FinishedRun& run : results.runs) out.push_back(&run);
  return out;
}

}  // namespace flamefield
