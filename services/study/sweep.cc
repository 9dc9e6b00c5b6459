#include "services/study/sweep.h"

#include <set>

namespace flamefield {

namespace {

constexpr std::size_t kMostRuns = 100'000;

std::size_t rows_together(const Study& study) {
  return study.together.empty() ? 1 : study.together.front().values.size();
}

std::size_t combinations(const Study& study) {
  std::size_t n = rows_together(study) * std::max<std::size_t>(1, study.cases.size());
  for (const StudyAxis& axis : study.axes) {
    if (n > kMostRuns) break;
    n *= axis.values.size();
  }
  return n;
}

void set(StudyRun& run, const std::string& key, const Setting& value) {
  run.flat[key] = value;
  run.swept.emplace_back(key, value);
}

// Combination `index` of a study, the last axis fastest.
StudyRun combination(const Study& study, std::size_t index) {
  StudyRun run;
  run.flat = study.settings;
  std::vector<std::size_t> at(study.axes.size());
  for (std::size_t a = study.axes.size(); a-- > 0;) {
    at[a] = index % study.axes[a].values.size();
    index /= study.axes[a].values.size();
  }
  const std::size_t row = index % rows_together(study);
  index /= rows_together(study);
  if (!study.cases.empty()) {
    const StudyCase& chosen = study.cases[index];
    run.case_name = chosen.name;
    for (const auto& [key, value] : chosen.settings) run.flat[key] = value;
  }
  for (const StudyAxis& axis : study.together) set(run, axis.key, axis.values[row]);
  for (std::size_t a = 0; a < at.size(); ++a) set(run, study.axes[a].key, study.axes[a].values[at[a]]);
  return run;
}

tl::unexpected<Error> about(const Study& study, const StudyRun& run, const Error& error) {
  const std::string label = run.label();
  return tl::unexpected(
      Error{error.code,
            concat(study.name, label.empty() ? "" : concat(", run '", label, "'"), ": ", error.message)});
}

}  // namespace

Result<StudyPlan> plan_runs(const std::vector<Study>& studies, FieldFiles& fields) {
  StudyPlan plan;
  std::set<std::string> known;
  std::size_t equal = 0;
  for (std::size_t s = 0; s < studies.size(); ++s) {
    const Study& study = studies[s];
    const std::size_t n = combinations(study), repeats = static_cast<std::size_t>(study.repeats);
    if (n * repeats > kMostRuns)
      return invalid_input(concat(study.name, " has more than ", kMostRuns, " runs"),
                           "that would take months", "sweep fewer values at a time");
    for (std::size_t c = 0; c < n; ++c) {
      StudyRun run = combination(study, c);
      run.study = s;
      auto settings = read_run_settings(run.flat, study.folder, fields);
      if (!settings) return about(study, run, settings.error());
      if (auto ring = make_ring(settings->ring(), settings->grid()); !ring)
        return about(study, run, ring.error());
      const int first_seed = settings->seed;
      for (int repeat = 0; repeat < study.repeats; ++repeat) {
        run.repeat = repeat;
        run.settings = *settings;
        run.settings.seed = first_seed + repeat;
        run.id = run.settings.id();
        if (study.solve) equal += !known.insert(run.id).second;
        plan.runs.push_back(run);
      }
    }
  }
  if (equal > 0)
    plan.notes.push_back(
        concat(equal, " of ", plan.runs.size(), " runs have the settings of another one; each is done once"));
  return plan;
}

}  // namespace flamefield
