#include "services/cli/bench_output.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

namespace flamefield {

std::string TextTable::text() const {
  std::vector<std::size_t> width;
  for (const auto& row : rows_) {
    width.resize(std::max(width.size(), row.size()), 0);
    for (std::size_t i = 0; i < row.size(); ++i) width[i] = std::max(width[i], row[i].size());
  }
  std::string out;
  for (const auto& row : rows_) {
    std::string line;
    for (std::size_t i = 0; i < row.size(); ++i) {
      const std::string space(width[i] - row[i].size(), ' ');
      line += i == 0 ? row[i] + space : "  " + space + row[i];
    }
    out += line + '\n';
  }
  return out;
}

std::string short_number(double value) {
  if (!std::isfinite(value)) return "-";
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", value);
  return text;
}

std::string fixed_number(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

void BenchProgress::operator()(const std::string& step) const {
  session_.check_stop();
  std::fprintf(stderr, "%s: %s\n", what_.c_str(), step.c_str());
}

BenchFolder::BenchFolder(const std::filesystem::path& below) {
  std::string name = (below / "flamefield-bench-XXXXXX").string();
  if (!::mkdtemp(name.data()))
    throw CommandFailure{ExitCode::Failed,
                         concat("'", below.string(), "' (no folder can be made in it) name another one")};
  path_ = name;
}

BenchFolder::~BenchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace flamefield
