#include "services/config/suggestion.h"

#include <algorithm>

#include "proto/error.h"
#include "proto/nearest_name.h"

namespace flamefield {

std::string suggest(std::string_view name, const std::vector<std::string_view>& known) {
  if (!known.empty()) {
    const std::string_view nearest = nearest_name(name, known);
    if (edit_distance(name, nearest) <= std::max<std::size_t>(2, nearest.size() / 3))
      return concat("did you mean '", nearest, "'?");
  }
  std::string list = "choose one of:";
  for (std::string_view candidate : known) list.append(" ").append(candidate);
  return list;
}

}  // namespace flamefield
