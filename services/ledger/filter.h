#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "proto/error.h"

// The filter language of --where:
//
//   filter    = and { "or" and }
//   and       = unit { "and" unit }
//   unit      = "not" unit | "(" filter ")" | field | field operator value | field "in" "(" value {"," value}
//   ")" operator  = "=" | "!=" | "<" | "<=" | ">" | ">=" | "~" | "!~"        ~ compares with * and ? in the
//   pattern value     = number | time | word | 'text' | "text" time      = 2026-03-01 | 2026-03-01T10:15 |
//   2026-03-01T10:15:30Z (always UTC) | now | -90d -12h -30min -5s
//
//   residual > 0.1 and solver in (mlem, hessian) and time >= 2026-03-01 and not tag = bad
//   capture ~ *-burst and (state = failed or stale)
//
// Values never become part of the SQL text: they are bound to it. Names only choose from a fixed list.
namespace flamefield {

using FilterValue = std::variant<std::int64_t, double, std::string>;

struct Filter {
  // A condition over the aliases r (runs), j (jobs), s (sets), c (captures), p (recipes), with the values as
  // ?1, ?2 ... Empty: always true.
  std::string condition;
  std::vector<FilterValue> values;
  bool mentions_runs = false;   // a field that only work has: solver, residual, state ...
  bool mentions_state = false;  // also work that is not done
};

enum class FilterOver { Runs, Sets };

// InvalidInput: says what is wrong and at which character. `now_ns`: what times like -2h count from.
// Over sets, fields of runs are a fault.
Result<Filter> parse_filter(std::string_view text, std::int64_t now_ns, FilterOver over = FilterOver::Runs);

// One line a field: its name, what it compares, what it means.
std::string filter_help();

}  // namespace flamefield
