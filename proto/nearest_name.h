#pragma once

#include <cstddef>
#include <span>
#include <string_view>

namespace flamefield {

// Levenshtein: how many letters to insert, remove or change.
std::size_t edit_distance(std::string_view a, std::string_view b);

// The candidate with the smallest distance, the first of equals. There must be one.
std::string_view nearest_name(std::string_view name, std::span<const std::string_view> candidates);

}  // namespace flamefield
