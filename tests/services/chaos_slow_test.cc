#include "tests/services/chaos.h"

#include <gtest/gtest.h>

namespace flamefield {
namespace {

TEST(Chaos, SixtySetsSurviveThirtyKills) {
  testing_support::expect_survival({.sets = 60, .kills = 30, .workers = 2});
}

}  // namespace
}  // namespace flamefield
