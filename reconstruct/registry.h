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
  std::function<Result<>(const Recipe&)> check;  // of its own table
  // After a successful check. InvalidInput: a problem that this solver cannot take, e.g. for its geometry.
  std::function<Result<Solution>(const Problem&, const Recipe&)> run;
  bool takes_start = true;  // whether a warm start is of use
  Division division = Division::None;
};

// The one list of solvers, default first.
std::span<const Solver> solvers();

}  // namespace flamefield
