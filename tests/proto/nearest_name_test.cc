#include "proto/nearest_name.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace flamefield {
namespace {

// The definition, without any memory of shorter words.
std::size_t distance_by_definition(std::string_view a, std::string_view b) {
  if (a.empty() || b.empty()) return std::max(a.size(), b.size());
  return std::min({distance_by_definition(a.substr(1), b) + 1, distance_by_definition(a, b.substr(1)) + 1,
                   distance_by_definition(a.substr(1), b.substr(1)) + (a[0] != b[0])});
}

TEST(NearestName, TheDistanceIsThatOfTheDefinition) {
  const unsigned seed = std::random_device{}();
  SCOPED_TRACE(seed);
  std::mt19937 engine(seed);
  const auto word = [&] {
    std::string letters(std::uniform_int_distribution<std::size_t>(0, 6)(engine), ' ');
    for (char& letter : letters) letter = std::uniform_int_distribution<int>(0, 2)(engine) ? 'a' : 'b';
    return letters;
  };
  for (int i = 0; i < 200; ++i) {
    const std::string a = word(), b = word();
    EXPECT_EQ(edit_distance(a, b), distance_by_definition(a, b)) << a << ' ' << b;
  }
}

TEST(NearestName, PrefersTheFirstOfEquals) {
  const std::vector<std::string_view> names = {"mlem", "map", "mart"};
  EXPECT_EQ(nearest_name("mlme", names), "mlem");
  EXPECT_EQ(nearest_name("mat", names), "map");
}

}  // namespace
}  // namespace flamefield
