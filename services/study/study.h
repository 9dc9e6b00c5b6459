#pragma once

#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "services/study/settings.h"

namespace flamefield {

// One swept key and the values it takes.
struct StudyAxis {
  std::string key;
  std::vector<Setting> values;
};

// A named set of settings, e.g. one method among several.
struct StudyCase {
  std::string name;
  Settings settings;
};

enum class FigureKind { Paths, Errors, Slices, Height, Scatter, Masks, Stability };
struct StudyFigure {
  FigureKind kind = FigureKind::Paths;
  std::string over;   // the swept key that is drawn, or "case"
  std::string paper;  // where its model is, e.g. "Fig. 5a"
  std::string caption;
  int samples = 3'000'000;  // of a mask
};

// A statement of the paper about this study, which the results have to bear out: `measure` is better among
// the favoured runs than among the others. Both groups follow from a swept key:
//   falls/rises  runs at the smallest value against those at the largest, or the other way round
//   above        runs whose value is larger than that of another setting, against the rest
//   better       runs of one case against those of another
struct StudyFinding {
  std::string claim, paper;
  std::string over;
  enum class Rule { Falls, Rises, Above, Cases } rule = Rule::Falls;
  std::string than;    // Above: the other setting; Cases: the case that is to be worse
  std::string better;  // Cases
  std::vector<std::string> measures = {"fitness"};
  std::string step_at;  // a setting that holds a generation at which a step is to be seen
};

// What the paper published about some of the runs.
struct StudyPublished {
  Settings when;                                              // keys and values that select runs
  std::string of_case;                                        // of this case; empty: any
  std::string source;                                         // "Section 3.3"
  std::string method;                                         // what it was there
  double pearson = std::numeric_limits<double>::quiet_NaN();  // NaN: not given
  double sqmd = std::numeric_limits<double>::quiet_NaN();
  double pearson_sd = 0, sqmd_sd = 0;
};

// A sweep over settings: every combination of the axes and the cases, each repeated with new seeds. Axes that
// run `together` take their values in step.
struct Study {
  std::string name, title, text, paper;
  std::filesystem::path folder;  // where relative paths start
  Settings settings;
  std::vector<StudyAxis> axes, together;
  std::vector<StudyCase> cases;
  int repeats = 1;
  bool keep_volumes = false;
  bool solve = true;  // false: figures of images and masks only
  int threads_per_run = 1;
  std::vector<StudyFigure> figures;
  std::vector<StudyFinding> findings;
  std::vector<StudyPublished> published;
  Settings quick;  // what a quick pass changes; "repeats" among them
};

// A run as the study names it.
struct StudyRun {
  std::size_t study = 0;  // index into the list of studies
  RunSettings settings;
  Settings flat;          // as it was put together
  std::string case_name;  // empty without cases
  std::vector<std::pair<std::string, Setting>> swept;
  int repeat = 0;
  std::string id;
  std::string label() const;  // "ERT, mutation rate 0.3, seed 2"
};

// The number of a setting, none for texts.
std::optional<double> number_of(const Setting& setting);

// "ert.mutation_rate" -> "mutation rate", for labels.
std::string spoken(std::string_view key);

}  // namespace flamefield
