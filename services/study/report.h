#pragma once

#include <string>
#include <vector>

#include "services/study/figures.h"
#include "services/study/findings.h"

namespace flamefield {

struct StudyReportOptions {
  std::string created;  // UTC, as it is to be printed
  bool quick = false;
  std::string command;             // that does it again
  std::vector<std::string> notes;  // what the reader should know: failures, an unfinished study
};

// One HTML file that needs nothing else: what the article published beside what we got, what it found and
// whether that holds here, and the figures of every study. Figures without runs are left out. Unavailable:
// gnuplot is missing.
Result<std::string> study_report(const std::vector<StudyResults>& results, const RecordStore& store,
                                 StudyScenes& scenes, const StudyReportOptions& options);

// Parts of it.
std::string published_section(const std::vector<StudyResults>& results);
std::string findings_section(const std::vector<StudyResults>& results);

}  // namespace flamefield
