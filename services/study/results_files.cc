// results.csv and results.json of a study.
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "services/study/results.h"

namespace flamefield {

namespace {

using nlohmann::json;

constexpr std::array<const char*, 6> kMeasures = {"pearson", "sqmd_3d", "sqmd_2d",
                                                  "ssim",    "fitness", "wall_s"};

std::string csv_cell(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string out(1, '"');
  for (char c : text) {
    if (c == '"') out.push_back('"');
    out.push_back(c);
  }
  out.push_back('"');
  return out;
}

std::string csv_number(double value) {
  return std::isfinite(value) ? text_of(Setting(value)) : "";
}

// Every key that is swept somewhere, in alphabetical order.
std::set<std::string> swept_keys(const std::vector<StudyResults>& results) {
  std::set<std::string> keys;
  for (const StudyResults& part : results)
    for (const FinishedRun& run : part.runs)
      for (const auto& [key, value] : run.run.swept) keys.insert(key);
  return keys;
}

json json_of(const FinishedRun& run) {
  json swept = json::object();
  for (const auto& [key, value] : run.run.swept)
    std::visit([&, &name = key](const auto& v) { swept[name] = v; }, value);
  json j = json::parse(json_of(run.record));
  j["case"] = run.run.case_name;
  j["swept"] = swept;
  j["seed"] = run.run.settings.seed;
  return j;
}

}  // namespace

std::string csv_of(const std::vector<StudyResults>& results) {
  const std::set<std::string> keys = swept_keys(results);
  std::string out = "study,case,phantom,solver,seed";
  for (const std::string& key : keys) out.append(1, ',').append(csv_cell(key));
  for (const char* name : kMeasures) out += concat(",", name);
  out += ",iterations,stop_reason,id\n";
  for (const StudyResults& part : results)
    for (const FinishedRun& run : part.runs) {
      out += concat(csv_cell(part.study.name), ',', csv_cell(run.run.case_name), ',',
                    csv_cell(run.record.phantom), ',', run.record.solver, ',', run.run.settings.seed);
      for (const std::string& key : keys) {
        out += ',';
        for (const auto& [name, value] : run.run.swept)
          if (name == key) out += csv_cell(text_of(value));
      }
      for (const char* name : kMeasures) out.append(1, ',').append(csv_number(measure(run.record, name)));
      out += concat(',', run.record.iterations, ',', csv_cell(run.record.stop_reason), ',', run.run.id, '\n');
    }
  return out;
}

std::string json_of(const std::vector<StudyResults>& results) {
  json list = json::array();
  for (const StudyResults& part : results) {
    json runs = json::array();
    for (const FinishedRun& run : part.runs) runs.push_back(json_of(run));
    list.push_back(
        {{"study", part.study.name}, {"title", part.study.title}, {"planned", part.planned}, {"runs", runs}});
  }
  return json{{"format", "flamefield-study-results-1"}, {"studies", list}}.dump(1) + "\n";
}

}  // namespace flamefield
