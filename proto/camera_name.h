#pragma once

#include <cstddef>
#include <string>

namespace flamefield {

// "cam00", "cam01", ...: cameras that nobody has named.
inline std::string camera_name(std::size_t number) {
  const std::string digits = std::to_string(number);
  return (digits.size() < 2 ? "cam0" : "cam") + digits;
}

}  // namespace flamefield
