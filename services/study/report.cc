#include "services/study/report.h"

#include <algorithm>
#include <cmath>

#include "services/report/html.h"
#include "services/report/page.h"

namespace flamefield {

namespace {

std::string strong_count(std::size_t done, std::size_t planned) {
  return done == planned ? concat(done, " runs") : concat(done, " of ", planned, " runs");
}

// Every run of a study, folded away: the page is for reading, results.csv for computing.
std::string runs_table(const StudyResults& part) {
  std::vector<std::vector<std::string>> rows = {{"Run", "Solver", "Pearson (1)", "SqMD 3D (1)", "SqMD 2D (1)",
                                                 "Fitness (1)", "Iterations", "Ended by", "Time (s)"}};
  for (const FinishedRun& run : part.runs) {
    const RunRecord& r = run.record;
    const std::string label = run.run.label();
    rows.push_back({escaped(label.empty() ? r.phantom : label), escaped(r.solver),
                    number(r.metrics.pearson, 4), number(r.metrics.sqmd, 3), number(r.sqmd_2d, 3),
                    number(measure(r, "fitness"), 5), concat(r.iterations), escaped(r.stop_reason),
                    number(r.wall_s, 3)});
  }
  if (part.planned == 0) return "";
  return concat("<details><summary>All ", strong_count(part.runs.size(), part.planned),
                " in figures</summary>", table(rows, "numbers"), "</details>\n");
}

Result<std::string> study_section(const StudyResults& part, const RecordStore& store, StudyScenes& scenes,
                                  std::size_t index) {
  std::string small, wide;
  for (std::size_t i = 0; i < part.study.figures.size(); ++i) {
    const StudyFigure& wanted = part.study.figures[i];
    const auto drawn = figure_html(wanted, {part, store, scenes, concat("s", index, "f", i)});
    if (!drawn) return drawn;
    (wanted.kind == FigureKind::Slices ? wide : small) += *drawn;
  }
  std::string lead = part.study.text;
  if (!part.study.paper.empty()) lead = concat(part.study.paper, ". ", lead);
  return section(part.study.title, lead,
                 concat(wide, "<div class=\"figures\">", small, "</div>", runs_table(part)));
}

std::string repeat_section(const std::vector<StudyResults>& results, const StudyReportOptions& options) {
  double wall_s = 0;
  std::size_t runs = 0;
  for (const StudyResults& part : results)
    for (const FinishedRun& run : part.runs) wall_s += run.record.wall_s, ++runs;
  std::string notes;
  for (const std::string& note : options.notes) notes += concat("<li>", escaped(note), "</li>");
  return section(
      "How to repeat it",
      concat(
          runs, " runs, ", number(wall_s / 60, 3),
          " minutes of solving, summed over the runs. Every run is a file of its own in runs/; results.csv "
          "and results.json hold all figures."),
      concat(notes.empty() ? "" : concat("<ul>", notes, "</ul>"),
             options.command.empty() ? "" : concat("<pre>", escaped(options.command), "</pre>")));
}

}  // namespace

Result<std::string> study_report(const std::vector<StudyResults>& results, const RecordStore& store,
                                 StudyScenes& scenes, const StudyReportOptions& options) {
  std::size_t done = 0, planned = 0;
  for (const StudyResults& part : results) done += part.runs.size(), planned += part.planned;
  std::string body = published_section(results) + findings_section(results);
  for (std::size_t i = 0; i < results.size(); ++i) {
    if (!results[i].first) continue;
    const auto part = study_section(results[i], store, scenes, i);
    if (!part) return part;
    body += *part;
  }
  body += repeat_section(results, options);
  const std::string subtitle = concat(strong_count(done, planned),
                                      options.quick ? ", quick pass with fewer generations and seeds" : "",
                                      options.created.empty() ? "" : " · ", options.created);
  const std::string title = results.empty() ? "Study" : results.front().study.title;
  return page(title, subtitle, body);
}

}  // namespace flamefield
