#pragma once

#include <functional>
#include <span>
#include <string_view>
#include <vector>

#include "reconstruct/problem.h"
#include "reconstruct/settings.h"

namespace flamefield {

struct Solver {
  std::string_view name;
  std::string_view summary;  // one line with its source
  std::function<std::vector<SettingDoc>()> settings;
  std::function<Result<>(const Recipe&)> check;                // of its own table
  std::function<Solution(const Problem&, const Recipe&)> run;  // after a successful check
};

// The one list of solvers, default first.
std::span<const Solver> solvers();

}  // namespace flamefield
