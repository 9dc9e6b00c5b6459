#include "proto/check.h"

#include <string>

namespace flamefield {

void expect(bool holds, std::string_view what, std::source_location where) {
  if (holds) return;
  throw ContractViolation(std::string(where.file_name()) + ":" + std::to_string(where.line()) + " " +
                          where.function_name() + ": " + std::string(what));
}

}  // namespace flamefield
