#include <fmt/chrono.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "proto/version.h"
#include "services/cli/bench_output.h"
#include "services/cli/commands.h"
#include "services/cli/progress.h"
#include "services/ledger/lock.h"
#include "services/store/file.h"
#include "services/study/estimate.h"
#include "services/study/report.h"
#include "services/study/runner.h"
#include "services/study/study_file.h"

namespace flamefield {

namespace {

struct Options {
  std::string study;
  std::filesystem::path out;
  StudyOptions reading;
  int jobs = 0;
  bool resume = false, again = false, dry_run = false, list = false, json = false;
};

struct Work {
  std::vector<Study> studies;
  FieldFiles fields;
  StudyPlan plan;
  StudyScenes scenes{fields};
};

std::string time_text(double seconds) {
  if (!std::isfinite(seconds)) return "?";
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 60) return concat(whole, " s");
  return whole < 3600 ? fmt::format("{}:{:02} min", whole / 60, whole % 60)
                      : fmt::format("{}:{:02} h", whole / 3600, whole / 60 % 60);
}

void list_studies() {
  for (const std::string& name : shipped_studies()) {
    const auto studies = or_fail(read_studies(name, {}));
    std::cout << fmt::format("{:<16}{}\n", name, studies.front().title);
  }
}

// Opens the folder without making one, for those who only want to look.
std::optional<RecordStore> existing_store(const std::filesystem::path& folder) {
  if (!std::filesystem::is_directory(folder / "runs")) return std::nullopt;
  return or_fail(RecordStore::open(folder));
}

void dry_run(const Options& options, Work& work, const Session& session) {
  const auto store = existing_store(options.out);
  ProgressBar bar("trials");
  const auto estimates =
      or_fail(estimate_runs(work.studies, work.plan, store ? &*store : nullptr, work.scenes, session.stop(),
                            [&](const std::string& name) { bar.update(0, 1, name); }));
  session.check_stop();
  TextTable table({"study", "run", "solver", "to do", "one core (s)"});
  double total_s = 0;
  std::size_t todo = 0;
  for (const RunEstimate& e : estimates) {
    const bool is_todo = !e.is_done && !e.is_twin;
    todo += is_todo;
    if (is_todo && std::isfinite(e.seconds)) total_s += e.seconds;
    table.add({work.studies[e.run->study].name, e.run->label(), e.run->settings.recipe.solver,
               e.is_done   ? "done"
               : e.is_twin ? "as another"
                           : "yes",
               is_todo ? short_number(e.seconds) : ""});
  }
  const int jobs =
      options.jobs > 0 ? options.jobs : static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
  std::cout << table.text() << '\n'
            << todo << " of " << estimates.size() << " runs to do, about " << time_text(total_s / jobs)
            << " with " << jobs << " at a time\n";
}

std::vector<StudyResults> collect(const Work& work, const RecordStore& store) {
  std::vector<StudyResults> results;
  for (const Study& study : work.studies) results.push_back({study});
  for (const StudyRun& run : work.plan.runs) {
    StudyResults& part = results[run.study];
    if (!part.first) part.first = run;
    if (!work.studies[run.study].solve) continue;
    ++part.planned;
    if (auto record = store.find(run.id)) part.runs.push_back({run, std::move(*record)});
  }
  return results;
}

FileLock lock(const std::filesystem::path& folder) {
  auto taken = FileLock::take(folder / "study.lock");
  if (!taken)
    throw CommandFailure{ExitCode::Failed,
                         concat("'", folder.string(),
                                "' is in use (another study writes there) wait for it or choose "
                                "another folder with --out")};
  return std::move(*taken);
}

RunnerSummary do_all(const Options& options, Work& work, const RecordStore& store, const Session& session) {
  if (options.again)
    for (const StudyRun& run : work.plan.runs) store.remove(run.id);
  ProgressBar bar(concat("study ", work.studies.front().name));
  RunnerOptions runner{.jobs = options.jobs};
  runner.progress = [&](double done, double total, double eta_s, const std::string& last) {
    bar.update(done, total,
               fmt::format("{} of {} runs, about {} left{}{}", static_cast<int>(done),
                           static_cast<int>(total), time_text(eta_s), last.empty() ? "" : "; last: ", last));
  };
  return or_fail(do_runs(work.studies, work.plan, store, work.scenes, runner, session.stop()));
}

void print_summary(const Options& options, const RunnerSummary& summary,
                   const std::vector<StudyResults>& results) {
  if (options.json) {
    nlohmann::json findings = nlohmann::json::array();
    for (const StudyResults& part : results)
      for (const StudyFinding& finding : part.study.findings)
        findings.push_back({{"claim", finding.claim}, {"verdict", name_of(judge(part, finding).verdict)}});
    std::cout << nlohmann::json{{"done", summary.done},
                                {"skipped", summary.skipped},
                                {"failed", summary.failures.size()},
                                {"findings", findings},
                                {"report", (options.out / "report.html").string()},
                                {"results", (options.out / "results.csv").string()}}
                     .dump(2)
              << '\n';
    return;
  }
  for (const StudyResults& part : results)
    for (const StudyFinding& finding : part.study.findings)
      std::cout << name_of(judge(part, finding).verdict) << ": " << finding.claim << " (" << finding.paper
                << ")\n";
  std::cout << summary.done << " runs done, " << summary.skipped << " known from before\n"
            << (options.out / "report.html").string() << '\n'
            << (options.out / "results.csv").string() << '\n';
}

void write_all(const Options& options, Work& work, const RecordStore& store, const RunnerSummary& summary,
               const Session& session) {
  const auto results = collect(work, store);
  or_fail(write_text_file(options.out / "results.csv", csv_of(results)));
  or_fail(write_text_file(options.out / "results.json", json_of(results)));
  if (summary.stopped) {
    throw CommandFailure{ExitCode::Failed,
                         concat("stopped (on request, ", summary.done + summary.skipped, " runs are kept in ",
                                options.out.string(), ") the same command goes on from there")};
  }
  StudyReportOptions report{.created = fmt::format("{:%Y-%m-%d %H:%M} UTC", fmt::gmtime(std::time(nullptr))),
                            .quick = options.reading.quick,
                            .command = session.command_line(),
                            .notes = work.plan.notes};
  for (const RunFailure& failure : summary.failures)
    report.notes.push_back(concat("Failed: ", failure.label, ": ", failure.error.message));
  or_fail(write_text_file(options.out / "report.html",
                          or_fail(study_report(results, store, work.scenes, report))));
  print_summary(options, summary, results);
  if (!summary.failures.empty())
    throw CommandFailure{ExitCode::Failed,
                         concat(summary.failures.size(), " runs failed (the first, '",
                                summary.failures.front().label, "': ", summary.failures.front().error.message,
                                ") the others are in the report; the same command tries again")};
}

void run(Options options, const Session& session) {
  if (options.list) return list_studies();
  if (options.study.empty())
    throw CommandFailure{ExitCode::Usage,
                         "no study was named (it is a file or a shipped one) see 'flamefield study --list'"};
  Work work;
  work.studies = or_usage(read_studies(options.study, options.reading));
  work.plan = or_usage(plan_runs(work.studies, work.fields));
  if (work.plan.runs.empty())
    throw CommandFailure{ExitCode::Usage, concat("study '", options.study,
                                                 "' has no runs (nothing to do) add a "
                                                 "phantom and a [sweep]")};
  if (options.out.empty()) options.out = concat("flamefield-study-", work.studies.front().name);
  if (options.dry_run) return dry_run(options, work, session);
  if (options.resume && !std::filesystem::is_directory(options.out / "runs"))
    throw CommandFailure{ExitCode::Usage,
                         concat("nothing to resume (there is no study in '", options.out.string(),
                                "') check --out or leave --resume out")};
  for (const std::string& note : work.plan.notes) std::cerr << "note: " << note << '\n';
  const RecordStore store = or_fail(RecordStore::open(options.out));
  const FileLock held = lock(options.out);
  const RunnerSummary summary = do_all(options, work, store, session);
  write_all(options, work, store, summary, session);
}

}  // namespace

void add_study(CLI::App& app, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command =
      app.add_subcommand("study", "Sweep settings over known fields; repeat the article's studies");
  command->add_option("STUDY", options->study,
                      "A TOML file, or a shipped study: 'paper' is all of the article's");
  command->add_option("--out,--output", options->out,
                      "Folder of records and report. Default: flamefield-study-NAME");
  command->add_flag("--quick", options->reading.quick, "Fewer generations and seeds, as the study says");
  command->add_option("--repeats", options->reading.repeats, "Seeds of every run")
      ->check(CLI::Range(1, 100000));
  command->add_option("--set", options->reading.settings, "For all runs: TABLE.KEY=VALUE, as often as needed")
      ->allow_extra_args(false);
  command->add_option("--jobs", options->jobs, "Runs at a time; 0: one a core")->check(CLI::Range(0, 1024));
  command->add_flag("--resume", options->resume,
                    "Refuse to start anew. Finished runs are never done twice anyway");
  command->add_flag("--again", options->again, "Do all runs again")->excludes("--resume");
  command->add_flag("--dry-run", options->dry_run, "List the runs and what they would take");
  command->add_flag("--list", options->list, "List the shipped studies");
  command->add_flag("--json", options->json, "Print the outcome as JSON");
  command->footer(
      "Examples:\n  flamefield study paper --quick --out paper\n  flamefield study my-sweep.toml --jobs 2");
  command->callback([options, &session] { session.choose([=, &session] { run(*options, session); }); });
}

}  // namespace flamefield
