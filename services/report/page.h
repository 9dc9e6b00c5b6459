#pragma once

#include <string>
#include <string_view>

namespace flamefield {

// A whole HTML page around sections: no network, no scripts, light and dark, printable. Title and subtitle
// are plain text.
std::string page(std::string_view title, std::string_view subtitle, std::string_view body);

}  // namespace flamefield
