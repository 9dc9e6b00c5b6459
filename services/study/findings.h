#pragma once

#include <string>
#include <vector>

#include "services/study/results.h"

namespace flamefield {

enum class Outcome { Holds, Partly, Fails, Unclear, NoData };
std::string_view name_of(Outcome verdict);

// One measure of the favoured runs against the others.
struct MeasureComparison {
  std::string measure;
  Spread favoured, others;
  double gain = 0;   // favoured - others, positive when favoured is better
  double error = 0;  // standard error of it; 0 when there are no repeats
  double rank = 0;   // Spearman's rank correlation over all values; NaN for cases
  Outcome verdict = Outcome::NoData;
};

struct FindingResult {
  StudyFinding finding;
  std::string favoured = {}, others = {};  // what the two groups are: "mutation rate 0.1"
  std::vector<MeasureComparison> comparisons = {};
  Outcome verdict = Outcome::NoData;
  std::vector<std::string> reasons = {};  // why, from the runs' histories: one sentence each
};

// Judges a finding by the runs alone. A gain counts when it is twice its standard error, and at least
// one hundredth of what could be gained; without repeats the latter only.
FindingResult judge(const StudyResults& results, const StudyFinding& finding);

}  // namespace flamefield
