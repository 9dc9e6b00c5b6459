#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>
#include <set>

#include "reconstruct/metrics.h"
#include "services/cli/connection.h"
#include "services/cli/runs_commands.h"
#include "services/store/volume_file.h"

namespace flamefield {

namespace {

using Json = nlohmann::ordered_json;

struct Options {
  DataOption data;
  std::vector<std::string> ids;
  RunSelection selection;
  bool json = false;
};

std::vector<WorkRow> chosen(const Options& options) {
  if (options.ids.empty()) return options.selection.read(options.data.dir);
  auto ledger = or_fail(LedgerQuery::open(options.data.dir));
  std::vector<WorkRow> rows;
  for (const std::string& id : options.ids) rows.push_back(or_usage(ledger.run(id)));
  return rows;
}

// Everything that tells a run, as text by name.
std::map<std::string, std::string> facts_of(const WorkRow& row) {
  const Run& run = row.run;
  std::map<std::string, std::string> facts = {{"solver", run.solver},
                                              {"rig", run.processing.rig_id},
                                              {"version", run.program_version},
                                              {"dark", run.processing.dark_capture},
                                              {"background", run.processing.background_capture},
                                              {"flat", run.processing.flat_capture},
                                              {"iterations", concat(run.iterations)},
                                              {"residual", fmt::format("{:.5f}", run.residual)},
                                              {"solve_s", fmt::format("{:.3f}", run.timings.solve_s)},
                                              {"peak_rss_mib", fmt::format("{:.0f}", run.peak_rss_mib)},
                                              {"stop_reason", run.stop_reason},
                                              {"host", run.host}};
  for (const auto& [key, setting] : run.processing.recipe.settings) facts[key] = flamefield::text_of(setting);
  for (const auto& [name, value] : run.metrics) facts["metric." + name] = fmt::format("{:.5f}", value);
  return facts;
}

// How the other volumes differ from the first, where their files are and their grids fit.
std::vector<std::optional<double>> pearsons(const Options& options, const std::vector<WorkRow>& rows) {
  std::vector<std::optional<double>> out(rows.size());
  const auto first = read_volume(options.data.dir / rows.front().run.volume_path);
  for (std::size_t i = 1; first && i < rows.size(); ++i) {
    const auto other = read_volume(options.data.dir / rows[i].run.volume_path);
    if (!other) continue;
    if (const auto metrics = compare(*first, *other)) out[i] = metrics->pearson;
  }
  return out;
}

void run(const Options& options) {
  const std::vector<WorkRow> rows = chosen(options);
  if (rows.size() < 2)
    throw CommandFailure{ExitCode::Usage, concat(rows.size(), " runs (two are needed to compare) name more")};
  std::vector<std::map<std::string, std::string>> facts;
  std::set<std::string> names;
  for (const WorkRow& row : rows) {
    facts.push_back(facts_of(row));
    for (const auto& [name, value] : facts.back()) names.insert(name);
  }
  std::erase_if(names, [&](const std::string& name) {
    return std::ranges::all_of(
        facts, [&](const auto& f) { return f.contains(name) && f.at(name) == facts[0].at(name); });
  });
  const auto against_first = pearsons(options, rows);
  Json all = Json::array();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    Json row = {{"run", rows[i].run.id}};
    for (const std::string& name : names)
      row[name] = facts[i].contains(name) ? Json(facts[i].at(name)) : Json(nullptr);
    row["pearson_with_first"] = against_first[i] ? Json(*against_first[i]) : Json(nullptr);
    all.push_back(std::move(row));
  }
  if (options.json) {
    std::cout << all.dump(2) << '\n';
    return;
  }
  for (std::size_t i = 0; i < rows.size(); ++i) std::cout << fmt::format("[{}] {}\n", i + 1, rows[i].run.id);
  for (const auto& [name, value] : all.front().items()) {
    if (name == "run") continue;
    std::cout << fmt::format("{:<28}", name);
    for (const Json& row : all)
      std::cout << fmt::format(" {:>16}", row[name].is_string() ? row[name].get<std::string>()
                                          : row[name].is_null()
                                              ? std::string("-")
                                              : fmt::format("{:.5f}", row[name].get<double>()));
    std::cout << '\n';
  }
}

}  // namespace

void add_compare(CLI::App& runs, Session& session) {
  auto options = std::make_shared<Options>();
  auto* command = runs.add_subcommand("compare", "What differs between runs, and between their volumes");
  add_data(*command, options->data);
  command->add_option("RUN", options->ids, "Two or more, as 'runs list' prints them");
  add_selection(*command, options->selection);
  command->add_flag("--json", options->json, "Print the result as JSON");
  command->footer(
      "Examples:\n  flamefield runs compare RUN RUN\n"
      "  flamefield runs compare --where 'capture = 20260301T101500000-burst and index = 3'");
  command->callback([options, &session] { session.choose([=] { run(*options); }); });
}

}  // namespace flamefield
