#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace flamefield {

// "did you mean 'torus'?" when a known name is close to the one given, else "choose one of: ...".
std::string suggest(std::string_view name, const std::vector<std::string_view>& known);

}  // namespace flamefield
