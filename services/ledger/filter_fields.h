#pragma once

#include <span>
#include <string_view>

// Known to this folder only: the fields of the filter language.
namespace flamefield {

enum class FieldType { Text, Number, Time, Truth, Tag, Metric };

struct FilterField {
  std::string_view name;
  FieldType type;
  bool is_of_runs;
  // Over the aliases of Filter::condition, where only what is done counts, and else. The only text of a
  // filter that gets into the SQL.
  std::string_view done_sql, any_sql;
  std::string_view help;
};

std::span<const FilterField> filter_fields();

}  // namespace flamefield
