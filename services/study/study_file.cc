#include "services/study/study_file.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "reconstruct/solver.h"
#include "services/config/suggestion.h"
#include "services/study/shipped.h"
#include "services/study/study_reader.h"

namespace flamefield {

namespace {

constexpr std::string_view kPrefix = "study-";

struct Source {
  TomlFile file;
  std::string name;
  std::filesystem::path folder;
};

Result<Source> open_study(const std::string& name_or_path, const std::filesystem::path& folder) {
  for (const ShippedRecipe& shipped : shipped_recipes()) {
    if (!shipped.name.starts_with(kPrefix)) continue;
    const std::string name(shipped.name.substr(kPrefix.size()));
    if (name_or_path != name && name_or_path != shipped.name) continue;
    auto file = parse_toml(std::string(shipped.text), concat(shipped.name, ".toml"));
    if (!file) return tl::unexpected(file.error());
    return Source{std::move(*file), name, std::filesystem::current_path()};
  }
  const std::filesystem::path path = folder / name_or_path;
  if (!std::filesystem::exists(path)) {
    const std::vector<std::string> names = shipped_studies();
    return not_found(concat("study '", name_or_path, "'"), "it is neither a file nor shipped",
                     suggest(name_or_path, {names.begin(), names.end()}));
  }
  auto file = read_toml(path);
  if (!file) return tl::unexpected(file.error());
  std::string name = path.stem().string();
  if (name.starts_with(kPrefix)) name = name.substr(kPrefix.size());
  const auto parent = std::filesystem::absolute(path).parent_path();
  return Source{std::move(*file), name, parent};
}

// A quick pass changes what all cases share; what a case says itself stands. The command line overrules both.
Result<> apply_options(Study& study, const StudyOptions& options) {
  if (options.quick) {
    for (const auto& [key, value] : study.quick) {
      const double number = number_of(value).value_or(1);
      if (key == "repeats") {
        study.repeats = static_cast<int>(number);
      } else if (key == "samples") {
        for (StudyFigure& figure : study.figures) figure.samples = static_cast<int>(number);
      } else {
        study.settings[key] = value;
      }
    }
  }
  if (options.repeats > 0) study.repeats = options.repeats;
  Recipe given;
  for (const std::string& assignment : options.settings)
    if (auto ok = assign(given, assignment); !ok) return ok;
  for (const auto& [key, value] : given.settings) {
    study.settings[key] = value;
    for (StudyCase& named : study.cases) named.settings.erase(key);
  }
  return {};
}

Result<> add_studies(const std::string& name, const std::filesystem::path& folder, int depth,
                     const StudyOptions& options, std::vector<Study>& out) {
  auto source = open_study(name, folder);
  if (!source) return tl::unexpected(source.error());
  auto study = read_study(source->file, source->name, source->folder);
  if (!study) return tl::unexpected(study.error());
  const auto include = source->file.entries.find("include");
  if (include == source->file.entries.end()) {
    if (auto ok = apply_options(*study, options); !ok) return ok;
    out.push_back(std::move(*study));
    return {};
  }
  if (depth > 3)
    return source->file.fault("include", "studies include each other", "there is no end to it",
                              "remove one of the includes");
  // A file that includes others is their head; with settings or figures of its own it is a study as well.
  study->repeats = 0;
  out.push_back(std::move(*study));
  for (const Setting& part : include->second.values)
    if (auto ok = add_studies(text_of(part), source->folder, depth + 1, options, out); !ok) return ok;
  return {};
}

}  // namespace

std::vector<std::string> shipped_studies() {
  std::vector<std::string> out;
  for (const ShippedRecipe& shipped : shipped_recipes())
    if (shipped.name.starts_with(kPrefix)) out.emplace_back(shipped.name.substr(kPrefix.size()));
  return out;
}

Result<std::vector<Study>> read_studies(const std::string& name_or_path, const StudyOptions& options) {
  std::vector<Study> studies;
  if (auto ok = add_studies(name_or_path, "", 0, options, studies); !ok) return tl::unexpected(ok.error());
  return studies;
}

}  // namespace flamefield
