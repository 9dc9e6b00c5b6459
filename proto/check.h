#pragma once

#include <source_location>
#include <stdexcept>
#include <string_view>

namespace flamefield {

// The caller broke a documented precondition. Caught only in main.
class ContractViolation : public std::logic_error {
 public:
  using std::logic_error::logic_error;
};

// Throws ContractViolation with file and line unless `holds`. `what` names the broken rule.
void expect(bool holds, std::string_view what, std::source_location where = std::source_location::current());

}  // namespace flamefield
