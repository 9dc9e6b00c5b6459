#include "proto/recipe.h"

#include <gtest/gtest.h>

namespace flamefield {
namespace {

TEST(Recipe, AssignmentsKeepTheirTypes) {
  Recipe recipe;
  ASSERT_TRUE(assign(recipe, "mlem.max_iterations=80"));
  ASSERT_TRUE(assign(recipe, "ert.sigma=0.2"));
  ASSERT_TRUE(assign(recipe, "prepare.clip_negative=false"));
  ASSERT_TRUE(assign(recipe, "ert.mask=gradient"));
  EXPECT_EQ(recipe.settings["mlem.max_iterations"], Setting(std::int64_t{80}));
  EXPECT_EQ(recipe.settings["ert.sigma"], Setting(0.2));
  EXPECT_EQ(recipe.settings["prepare.clip_negative"], Setting(false));
  EXPECT_EQ(recipe.settings["ert.mask"], Setting(std::string("gradient")));
}

TEST(Recipe, BadAssignmentsAreRefused) {
  Recipe recipe;
  for (const char* text : {"", "mlem", "mlem.max", "=3", ".a=3", "mlem.=3", "mlem=3"}) {
    EXPECT_FALSE(assign(recipe, text)) << text;
  }
}

TEST(Recipe, FingerprintTellsEverySettingApart) {
  Recipe a, b;
  EXPECT_EQ(fingerprint(a), fingerprint(b));
  b.settings["mlem.max_iterations"] = std::int64_t{80};
  EXPECT_NE(fingerprint(a), fingerprint(b));
  a.settings["mlem.max_iterations"] = 80.0;
  EXPECT_NE(fingerprint(a), fingerprint(b));
}

}  // namespace
}  // namespace flamefield
