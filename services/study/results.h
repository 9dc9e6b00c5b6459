#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "services/study/record.h"
#include "services/study/study.h"

namespace flamefield {

struct FinishedRun {
  StudyRun run;
  RunRecord record;
};

// A study with those of its runs that are done.
struct StudyResults {
  Study study;
  std::vector<FinishedRun> runs = {};
  std::size_t planned = 0;
  std::optional<StudyRun> first = {};  // of the planned runs
};

// What was measured of a run: "fitness", "pearson", "sqmd_3d", "sqmd_2d". Fitness is the last of the history
// of an evolutionary solver, else that of the rendered volume.
double measure(const RunRecord& record, std::string_view name);
bool is_better_when_high(std::string_view measure);
std::string_view symbol_of(std::string_view measure);  // for axes and tables, with its unit

// Of repeated measurements; NaN is left out. sd: of the sample, NaN for fewer than two.
struct Spread {
  std::size_t count = 0;
  double mean = std::numeric_limits<double>::quiet_NaN(), sd = std::numeric_limits<double>::quiet_NaN();
};
Spread spread_of(const std::vector<double>& values);
std::string text_of(const Spread& spread, int digits);  // "0.8831 ± 0.0014 (15)"

// The value of a swept key, or of "case", in a run; empty text when it has none.
Setting value_of(const StudyRun& run, std::string_view over);
std::string name_of_value(const StudyRun& run, std::string_view over);  // for legends: "0.3", "ERT"

// Runs in groups of equal `over`, numbers ascending, names in the order of the study.
struct RunGroup {
  std::string name;
  Setting value;
  std::vector<const FinishedRun*> runs;
};
std::vector<RunGroup> groups_of(const std::vector<const FinishedRun*>& runs, std::string_view over);
std::vector<const FinishedRun*> all_of(const StudyResults& results);

// One row a run: swept keys, then the figures. RFC 4180; and the same as JSON with histories.
std::string csv_of(const std::vector<StudyResults>& results);
std::string json_of(const std::vector<StudyResults>& results);

}  // namespace flamefield
