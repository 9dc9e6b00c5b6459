// The article's figures beside ours, and its findings judged by our runs.
#include <cmath>

#include "services/report/html.h"
#include "services/study/report.h"

namespace flamefield {

namespace {

using Rows = std::vector<std::vector<std::string>>;

std::string chip(const char* css_class, std::string_view words) {
  return concat("<span class=\"chip ", css_class, "\">", escaped(words), "</span>");
}

std::vector<const FinishedRun*> runs_of(const StudyResults& results, const StudyPublished& row) {
  std::vector<const FinishedRun*> out;
  for (const FinishedRun& run : results.runs) {
    bool fits = row.of_case.empty() || run.run.case_name == row.of_case;
    for (const auto& [key, value] : row.when) {
      const auto own = run.run.flat.find(key);
      fits = fits && own != run.run.flat.end() && text_of(own->second) == text_of(value);
    }
    if (fits) out.push_back(&run);
  }
  return out;
}

Spread spread(const std::vector<const FinishedRun*>& runs, std::string_view name) {
  std::vector<double> values;
  for (const FinishedRun* run : runs) values.push_back(measure(run->record, name));
  return spread_of(values);
}

// Better or worse than the article by more than a tenth of its distance to perfection, else alike.
std::string verdict(const Spread& ours, double theirs, bool high_is_good) {
  if (ours.count == 0 || !std::isfinite(theirs)) return chip("", "–");
  const double gain = high_is_good ? ours.mean - theirs : theirs - ours.mean;
  const double room = high_is_good ? 1 - theirs : theirs;
  if (gain > 0.1 * room) return chip("good", "✓ better");
  return gain < -0.1 * room ? chip("poor", "✗ worse") : chip("fair", "≈ alike");
}

std::string theirs_text(double mean, double sd) {
  if (!std::isfinite(mean)) return "–";
  return text_of(Spread{sd > 0 ? 2u : 1u, mean, sd}, 4);
}

const char* class_of(Outcome v) {
  switch (v) {
    case Outcome::Holds:
      return "good";
    case Outcome::Partly:
    case Outcome::Unclear:
      return "fair";
    case Outcome::Fails:
      return "poor";
    case Outcome::NoData:
      return "";
  }
  return "";
}
const char* mark_of(Outcome v) {
  return v == Outcome::Holds ? "✓ " : v == Outcome::Fails ? "✗ " : v == Outcome::NoData ? "" : "~ ";
}

std::string comparison_text(const FindingResult& result) {
  std::string out;
  for (const MeasureComparison& c : result.comparisons) {
    const std::string_view full = symbol_of(c.measure);
    const int digits = c.measure == "fitness" ? 5 : 4;
    out += concat(out.empty() ? "" : "<br/>", escaped(full.substr(0, full.find(" (1)"))), ": <strong>",
                  text_of(c.favoured, digits), "</strong> against ", text_of(c.others, digits));
    if (std::isfinite(c.rank)) out += concat(" (rank correlation ", number(c.rank, 2), ")");
  }
  return out;
}

}  // namespace

std::string published_section(const std::vector<StudyResults>& results) {
  Rows rows = {{"Phantom", "Method", "Pearson, article", "Pearson, ours", "", "SqMD, article", "SqMD, ours",
                "", "Where", "Time of a run (s)"}};
  for (const StudyResults& part : results)
    for (const StudyPublished& row : part.study.published) {
      const auto runs = runs_of(part, row);
      if (runs.empty()) continue;
      const Spread pearson = spread(runs, "pearson"), sqmd = spread(runs, "sqmd_3d"),
                   wall = spread(runs, "wall_s");
      rows.push_back({escaped(runs.front()->record.phantom),
                      escaped(row.method.empty() ? row.of_case : row.method),
                      theirs_text(row.pearson, row.pearson_sd),
                      concat("<strong>", text_of(pearson, 4), "</strong>",
                             runs.size() > 1 ? concat(" (", runs.size(), " runs)") : ""),
                      verdict(pearson, row.pearson, true), theirs_text(row.sqmd, row.sqmd_sd),
                      concat("<strong>", text_of(sqmd, 4), "</strong>"), verdict(sqmd, row.sqmd, false),
                      escaped(row.source), number(wall.mean, 3)});
    }
  if (rows.size() == 1) return "";
  return section("The article's figures beside ours",
                 "Its phantoms came from flame simulations that are not public; ours are generated flames of "
                 "the same kind, size "
                 "and number of views, rendered three times finer than they are reconstructed. So the "
                 "numbers say what the methods "
                 "reach on comparable fields, not on the same ones. Better or worse: by more than a tenth of "
                 "what the article left "
                 "to gain.",
                 table(rows, "beside"));
}

std::string findings_section(const std::vector<StudyResults>& results) {
  Rows rows = {{"The article says", "Figures (favoured against the rest)", "Verdict", "Why"}};
  for (const StudyResults& part : results)
    for (const StudyFinding& finding : part.study.findings) {
      const FindingResult r = judge(part, finding);
      std::string why;
      for (const std::string& reason : r.reasons) why += concat(why.empty() ? "" : " ", escaped(reason));
      rows.push_back({concat("<div class=\"claim\">", escaped(finding.claim), " <span class=\"chip\">",
                             escaped(finding.paper), "</span></div>"),
                      concat("<strong>", escaped(r.favoured), "</strong> against ", escaped(r.others),
                             "<br/>", comparison_text(r)),
                      chip(class_of(r.verdict), concat(mark_of(r.verdict), name_of(r.verdict))),
                      concat("<div class=\"why\">", why, "</div>")});
    }
  if (rows.size() == 1) return "";
  return section(
      "Do the article's findings hold?",
      "Computed from the runs below. A difference counts when it is twice its standard error over the "
      "seeds, and at least a hundredth of what was left to gain.",
      table(rows, "findings"));
}

}  // namespace flamefield
