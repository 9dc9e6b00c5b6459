#include "services/study/study_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "reconstruct/solver.h"
#include "services/config/suggestion.h"

namespace flamefield {

namespace {

constexpr std::size_t kMostValues = 10'000;

// "figure[3].over" -> 3 and "over"; none for other tables.
struct Member {
  std::size_t index;
  std::string key;
};
std::optional<Member> member_of(const std::string& key, std::string_view list) {
  if (!key.starts_with(list) || key.size() <= list.size() || key[list.size()] != '[') return std::nullopt;
  const auto close = key.find("].");
  if (close == std::string::npos) return std::nullopt;
  return Member{std::stoul(key.substr(list.size() + 1)), key.substr(close + 2)};
}

class Reader {
 public:
  Reader(const TomlFile& file, Study& study) : file_(file), study_(study) {}

  Result<> read() {
    for (const auto& [key, entry] : file_.entries)
      if (auto ok = take(key, entry); !ok) return ok;
    if (auto ok = take_ranges(); !ok) return ok;
    return check_whole();
  }

 private:
  tl::unexpected<Error> unknown(const std::string& key, std::string_view name,
                                const std::vector<std::string_view>& known) const {
    return file_.fault(key, concat("unknown key '", name, "'"), "nothing reads it", suggest(name, known));
  }
  tl::unexpected<Error> wrong(const std::string& key, std::string_view expected) const {
    return file_.fault(key, concat("'", key, "' has the wrong type"), concat("it must be ", expected),
                       "mend the line");
  }

  Result<> take(const std::string& key, const TomlEntry& entry) {
    if (key.starts_with("sweep.")) return take_axis(key, key.substr(6), entry, study_.axes);
    if (key.starts_with("together.")) return take_axis(key, key.substr(9), entry, study_.together);
    if (const auto m = member_of(key, "case")) return take_case(key, *m, entry);
    if (const auto m = member_of(key, "figure")) return take_figure(key, *m, entry);
    if (const auto m = member_of(key, "finding")) return take_finding(key, *m, entry);
    if (const auto m = member_of(key, "published")) return take_published(key, *m, entry);
    if (key.starts_with("quick.")) return take_quick(key, entry);
    if (key.starts_with("run.")) return take_run(key, entry);
    if (key == "include") return entry.is_list ? Result<>{} : wrong(key, "a list of studies");
    if (key == "phantom.size") return take_size(key, entry);
    if (key == "title") return text(key, entry, study_.title);
    if (key == "text") return text(key, entry, study_.text);
    if (key == "paper") return text(key, entry, study_.paper);
    if (key == "repeats") return whole(key, entry, 1, 100'000, study_.repeats);
    return take_setting(key, key, entry, study_.settings);
  }

  Result<> text(const std::string& key, const TomlEntry& entry, std::string& out) const {
    if (entry.is_list || !std::holds_alternative<std::string>(entry.values[0])) return wrong(key, "a text");
    out = std::get<std::string>(entry.values[0]);
    return {};
  }
  Result<> real(const std::string& key, const TomlEntry& entry, double& out) const {
    const auto number = entry.is_list ? std::nullopt : number_of(entry.values[0]);
    if (!number || !std::isfinite(*number)) return wrong(key, "a number");
    out = *number;
    return {};
  }
  Result<> whole(const std::string& key, const TomlEntry& entry, int low, int high, int& out) const {
    double number = 0;
    if (auto ok = real(key, entry, number); !ok) return ok;
    if (number < low || number > high || number != std::floor(number))
      return wrong(key, concat("a whole number, ", low, " to ", high));
    out = static_cast<int>(number);
    return {};
  }

  // A setting of the runs, checked alone so that a fault has its line.
  Result<> check_setting(const std::string& at, const std::string& key, const Setting& value) {
    if (key == "phantom.field_spacing_mm") return {};  // means nothing alone
    if (key != "solver" && key != "recipe") {
      const auto dot = key.find('.');
      if (dot == std::string::npos)
        return unknown(at, key, {"title", "text", "paper", "solver", "recipe", "repeats", "include"});
      std::vector<std::string_view> tables = {"phantom", "cameras", "images", "solve",
                                              "run",     "sweep",   "quick",  "together"};
      for (std::string_view table : solver_names()) tables.push_back(table);
      for (std::string_view table : shared_tables()) tables.push_back(table);
      const std::string table = key.substr(0, dot);
      if (std::ranges::find(tables, table) == tables.end())
        return file_.fault(at, concat("unknown table [", table, "]"), "nothing reads it",
                           suggest(table, tables));
    }
    const auto alone = read_run_settings({{key, value}}, study_.folder, fields_);
    if (!alone) return prefixed(at, alone.error());
    return {};
  }
  tl::unexpected<Error> prefixed(const std::string& at, const Error& error) const {
    const auto entry = file_.entries.find(at);
    const int line = entry == file_.entries.end() ? 0 : entry->second.line;
    return tl::unexpected(Error{error.code, concat(file_.path.string(), ":", line, ": ", error.message)});
  }

  Result<> take_setting(const std::string& at, const std::string& key, const TomlEntry& entry,
                        Settings& out) {
    if (entry.is_list) return wrong(at, "one value; values to sweep belong into [sweep]");
    if (auto ok = check_setting(at, key, entry.values[0]); !ok) return ok;
    out[key] = entry.values[0];
    return {};
  }

  Result<> take_size(const std::string& key, const TomlEntry& entry) {
    if (!entry.is_list || entry.values.size() != 3) return wrong(key, "a list [NX, NY, NZ]");
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::string name = concat("phantom.n", "xyz"[axis]);
      if (auto ok = check_setting(key, name, entry.values[axis]); !ok) return ok;
      study_.settings[name] = entry.values[axis];
    }
    return {};
  }

  Result<> take_axis(const std::string& at, const std::string& key, const TomlEntry& entry,
                     std::vector<StudyAxis>& out) {
    if (!entry.is_list) {  // a part of { from, to, step }, or a single value
      const auto dot = key.rfind('.');
      const std::string last = key.substr(dot + 1);
      if (dot != std::string::npos && (last == "from" || last == "to" || last == "step" || last == "count")) {
        double value = 0;
        if (auto ok = real(at, entry, value); !ok) return ok;
        auto& range = ranges_[key.substr(0, dot)];
        range.at = at;
        range.together = &out == &study_.together;
        range.numbers[last] = value;
        range.is_whole = range.is_whole && std::holds_alternative<std::int64_t>(entry.values[0]);
        return {};
      }
      return wrong(at, "a list of values or { from, to, step }");
    }
    if (entry.values.empty())
      return file_.fault(at, concat("the sweep of ", key, " is empty"), "there would be no runs",
                         "give at least one value");
    if (entry.values.size() > kMostValues) return wrong(at, concat("at most ", kMostValues, " values"));
    for (const Setting& value : entry.values)
      if (auto ok = check_setting(at, key, value); !ok) return ok;
    out.push_back({key, entry.values});
    return {};
  }

  struct Range {
    std::string at;
    bool together = false, is_whole = true;
    std::map<std::string, double> numbers;
  };
  Result<> take_ranges() {
    for (auto& [key, range] : ranges_) {
      auto& n = range.numbers;
      const bool by_step = n.contains("step"), by_count = n.contains("count");
      if (!n.contains("from") || !n.contains("to") || by_step == by_count)
        return file_.fault(range.at, concat("the range of ", key, " is not clear"),
                           "it needs from, to, and either step or count",
                           "e.g. { from = 0, to = 1, step = 0.1 }");
      const double from = n["from"], to = n["to"];
      const double count = by_count ? n["count"] : std::floor((to - from) / n["step"] * (1 + 1e-12)) + 1;
      if (!(count >= 1) || !(count <= kMostValues) || (by_step && n["step"] == 0))
        return file_.fault(range.at, concat("the sweep of ", key, " is empty or endless"),
                           "its values do not lead from 'from' to 'to'", "check the sign of the step");
      StudyAxis axis{key, {}};
      for (int i = 0; i < static_cast<int>(count); ++i) {
        const double step = by_step ? n["step"] : count > 1 ? (to - from) / (std::floor(count) - 1) : 0;
        const double value = std::round((from + i * step) * 1e12) / 1e12;  // 0.30000000000000004 is 0.3
        if (range.is_whole && value == std::floor(value))
          axis.values.emplace_back(static_cast<std::int64_t>(value));
        else
          axis.values.emplace_back(value);
        if (auto ok = check_setting(range.at, key, axis.values.back()); !ok) return ok;
      }
      (range.together ? study_.together : study_.axes).push_back(std::move(axis));
    }
    return {};
  }

  Result<> take_case(const std::string& at, const Member& m, const TomlEntry& entry) {
    if (m.index >= study_.cases.size()) study_.cases.resize(m.index + 1);
    if (m.key == "name") return text(at, entry, study_.cases[m.index].name);
    return take_setting(at, m.key, entry, study_.cases[m.index].settings);
  }

  Result<> take_figure(const std::string& at, const Member& m, const TomlEntry& entry) {
    if (m.index >= study_.figures.size()) study_.figures.resize(m.index + 1);
    StudyFigure& figure = study_.figures[m.index];
    if (m.key == "over") return text(at, entry, figure.over);
    if (m.key == "paper") return text(at, entry, figure.paper);
    if (m.key == "caption") return text(at, entry, figure.caption);
    if (m.key == "samples") return whole(at, entry, 1, 1'000'000'000, figure.samples);
    if (m.key != "kind") return unknown(at, m.key, {"kind", "over", "paper", "caption", "samples"});
    static constexpr std::array<std::string_view, 7> kNames = {"paths",   "errors", "slices",   "height",
                                                               "scatter", "masks",  "stability"};
    std::string name;
    if (auto ok = text(at, entry, name); !ok) return ok;
    const auto found = std::ranges::find(kNames, name);
    if (found == kNames.end())
      return file_.fault(at, concat("unknown figure '", name, "'"), "there is none of this kind",
                         suggest(name, {kNames.begin(), kNames.end()}));
    figure.kind = static_cast<FigureKind>(found - kNames.begin());
    return {};
  }

  Result<> take_finding(const std::string& at, const Member& m, const TomlEntry& entry) {
    if (m.index >= study_.findings.size()) study_.findings.resize(m.index + 1);
    StudyFinding& finding = study_.findings[m.index];
    using Rule = StudyFinding::Rule;
    std::string word;
    if (m.key == "measures") {
      finding.measures.clear();
      for (const Setting& name : entry.values) finding.measures.push_back(text_of(name));
      for (const std::string& name : finding.measures)
        if (name != "fitness" && name != "pearson" && name != "sqmd_3d" && name != "sqmd_2d")
          return file_.fault(at, concat("unknown measure '", name, "'"), "it cannot be compared",
                             suggest(name, {"fitness", "pearson", "sqmd_3d", "sqmd_2d"}));
      return {};
    }
    if (auto ok = text(at, entry, word); !ok) return ok;
    if (m.key == "claim") return finding.claim = word, Result<>{};
    if (m.key == "paper") return finding.paper = word, Result<>{};
    if (m.key == "over") return finding.over = word, Result<>{};
    if (m.key == "step_at") return finding.step_at = word, Result<>{};
    if (m.key == "above") return finding.rule = Rule::Above, finding.than = word, Result<>{};
    if (m.key == "better") return finding.rule = Rule::Cases, finding.better = word, Result<>{};
    if (m.key == "than") return finding.than = word, Result<>{};
    if (m.key != "better_when")
      return unknown(
          at, m.key,
          {"claim", "paper", "over", "better_when", "above", "better", "than", "measures", "step_at"});
    if (word != "low" && word != "high") return wrong(at, "\"low\" or \"high\"");
    finding.rule = word == "low" ? Rule::Falls : Rule::Rises;
    return {};
  }

  Result<> take_published(const std::string& at, const Member& m, const TomlEntry& entry) {
    if (m.index >= study_.published.size()) study_.published.resize(m.index + 1);
    StudyPublished& row = study_.published[m.index];
    if (m.key.starts_with("when.")) return take_setting(at, m.key.substr(5), entry, row.when);
    if (m.key == "case") return text(at, entry, row.of_case);
    if (m.key == "source") return text(at, entry, row.source);
    if (m.key == "method") return text(at, entry, row.method);
    if (m.key == "pearson") return real(at, entry, row.pearson);
    if (m.key == "sqmd") return real(at, entry, row.sqmd);
    if (m.key == "pearson_sd") return real(at, entry, row.pearson_sd);
    if (m.key == "sqmd_sd") return real(at, entry, row.sqmd_sd);
    return unknown(at, m.key,
                   {"case", "source", "method", "pearson", "sqmd", "pearson_sd", "sqmd_sd", "when"});
  }

  Result<> take_quick(const std::string& at, const TomlEntry& entry) {
    const std::string key = at.substr(6);
    if (key != "repeats" && key != "samples") return take_setting(at, key, entry, study_.quick);
    int number = 0;
    if (auto ok = whole(at, entry, 1, 1'000'000'000, number); !ok) return ok;
    study_.quick[key] = entry.values[0];
    return {};
  }

  Result<> take_run(const std::string& at, const TomlEntry& entry) {
    if (at == "run.threads") return whole(at, entry, 1, 1024, study_.threads_per_run);
    if (at != "run.keep_volumes" && at != "run.solve")
      return unknown(at, at.substr(4), {"threads", "keep_volumes", "solve"});
    if (entry.is_list || !std::holds_alternative<bool>(entry.values[0])) return wrong(at, "true or false");
    (at == "run.solve" ? study_.solve : study_.keep_volumes) = std::get<bool>(entry.values[0]);
    return {};
  }

  Result<> check_whole() const {
    for (std::size_t i = 0; i < study_.cases.size(); ++i) {
      if (study_.cases[i].name.empty())
        return file_.fault("", concat("case ", i + 1, " has no name"), "tables and figures call it by name",
                           "add name = \"...\" to its [[case]]");
      for (std::size_t k = 0; k < i; ++k)
        if (study_.cases[k].name == study_.cases[i].name)
          return file_.fault(concat("case[", i, "].name"),
                             concat("two cases are called ", study_.cases[i].name),
                             "figures could not tell them apart", "give each a name of its own");
    }
    for (const StudyAxis& axis : study_.together)
      if (axis.values.size() != study_.together.front().values.size())
        return file_.fault(
            concat("together.", axis.key),
            concat(axis.key, " has ", axis.values.size(), " values, ", study_.together.front().key, " has ",
                   study_.together.front().values.size()),
            "what is swept together needs lists of one length", "use [sweep] for all combinations");
    return check_names();
  }

  // What figures and findings refer to must be swept.
  Result<> check_names() const {
    std::vector<std::string_view> swept = {"case"};
    for (const auto* axes : {&study_.axes, &study_.together})
      for (const StudyAxis& axis : *axes) swept.push_back(axis.key);
    const auto check = [&](const std::string& at, const std::string& over) -> Result<> {
      if (over.empty() || std::ranges::find(swept, over) != swept.end()) return {};
      return file_.fault(at, concat("'", over, "' is not swept"), "nothing varies with it",
                         suggest(over, swept));
    };
    for (std::size_t i = 0; i < study_.figures.size(); ++i)
      if (auto ok = check(concat("figure[", i, "].over"), study_.figures[i].over); !ok) return ok;
    for (std::size_t i = 0; i < study_.findings.size(); ++i)
      if (auto ok = check(concat("finding[", i, "].over"), study_.findings[i].over); !ok) return ok;
    std::vector<std::string_view> cases;
    for (const StudyCase& named : study_.cases) cases.push_back(named.name);
    for (std::size_t i = 0; i < study_.findings.size(); ++i) {
      const StudyFinding& f = study_.findings[i];
      if (f.rule != StudyFinding::Rule::Cases) continue;
      for (const std::string& name : {f.better, f.than})
        if (std::ranges::find(cases, name) == cases.end())
          return file_.fault(concat("finding[", i, "].better"), concat("there is no case '", name, "'"),
                             "the finding compares two cases", suggest(name, cases));
    }
    return {};
  }

  const TomlFile& file_;
  Study& study_;
  FieldFiles fields_;
  std::map<std::string, Range> ranges_;
};

}  // namespace

Result<Study> read_study(const TomlFile& file, const std::string& name, const std::filesystem::path& folder) {
  Study study;
  study.name = name;
  study.folder = folder;
  study.title = name;
  if (auto ok = Reader(file, study).read(); !ok) return tl::unexpected(ok.error());
  return study;
}

}  // namespace flamefield
