#include "services/reprocess/sweep.h"

namespace flamefield {

namespace {

constexpr std::size_t kMostCombinations = 10'000;

}  // namespace

Result<std::vector<std::vector<std::string>>> sweep_combinations(const std::vector<std::string>& sweeps) {
  std::vector<std::vector<std::string>> all = {{}};
  for (const std::string& sweep : sweeps) {
    const std::size_t equals = sweep.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == sweep.size())
      return invalid_input(concat("sweep '", sweep, "'"), "it does not say which values",
                           "write TABLE.KEY=A,B,C");
    std::vector<std::vector<std::string>> next;
    std::size_t from = equals + 1;
    while (from <= sweep.size()) {
      const std::size_t comma = std::min(sweep.find(',', from), sweep.size());
      if (comma == from)
        return invalid_input(concat("sweep '", sweep, "'"), "a value is empty", "write TABLE.KEY=A,B,C");
      for (std::vector<std::string> combination : all) {
        combination.push_back(sweep.substr(0, equals + 1) + sweep.substr(from, comma - from));
        next.push_back(std::move(combination));
        if (next.size() > kMostCombinations)
          return invalid_input("sweep", concat("it has more than ", kMostCombinations, " combinations"),
                               "sweep fewer values");
      }
      from = comma + 1;
    }
    all = std::move(next);
  }
  return all;
}

}  // namespace flamefield
