#include "services/ledger/filter.h"

#include <gtest/gtest.h>

#include <random>

namespace flamefield {
namespace {

constexpr std::int64_t kNow = 1'772'359'200'000'000'000;  // 2026-03-01T10:00:00Z

std::string fault_of(std::string_view text, FilterOver over = FilterOver::Runs) {
  const auto filter = parse_filter(text, kNow, over);
  return filter ? "accepted" : filter.error().message;
}

template <class T>
T only_value(std::string_view text) {
  const auto filter = parse_filter(text, kNow);
  EXPECT_TRUE(filter) << filter.error().message;
  EXPECT_EQ(filter->values.size(), 1u);
  return std::get<T>(filter->values.at(0));
}

TEST(Filter, ValuesAreBoundAndNeverBecomePartOfTheSql) {
  const auto filter =
      parse_filter("capture = \"x'; DROP TABLE runs; --\" or solver ~ 'm*' or residual > 0.25", kNow);
  ASSERT_TRUE(filter) << filter.error().message;
  EXPECT_EQ(filter->condition.find("DROP"), std::string::npos);
  EXPECT_EQ(filter->condition.find("0.25"), std::string::npos);
  ASSERT_EQ(filter->values.size(), 3u);
  EXPECT_EQ(std::get<std::string>(filter->values[0]), "x'; DROP TABLE runs; --");
}

// Whatever is typed, the SQL holds no letter that is not from the program's own list.
TEST(Filter, RandomTextIsRefusedOrBound) {
  std::mt19937 random(20260301);
  const std::string alphabet = "abz019 '\"()=<>!~,;-*?._%\\\n\t:/[]&|";
  const std::vector<std::string> words = {"capture",  "residual", "and", "or",   "not", "in", "state",
                                          "metric.x", "tag",      "=",   ">",    "(",   ")",  "'a'",
                                          "1",        "stale",    ",",   "time", "-2h"};
  int accepted = 0;
  for (int n = 0; n < 20'000; ++n) {
    std::string text;
    for (int i = 0; i < 12; ++i) {
      if (random() % 4 == 0) {
        text += alphabet[random() % alphabet.size()];
      } else {
        text += words[random() % words.size()];
        text += ' ';
      }
    }
    const auto filter = parse_filter(text, kNow);
    if (!filter) {
      EXPECT_EQ(filter.error().code, ErrorCode::InvalidInput);
      continue;
    }
    ++accepted;
    EXPECT_EQ(filter->condition.find(';'), std::string::npos) << text;
    EXPECT_EQ(filter->condition.find("--"), std::string::npos) << text;
    EXPECT_EQ(filter->condition.find('"'), std::string::npos) << text;
  }
  RecordProperty("accepted", accepted);
}

TEST(Filter, TimesAreUtcOrCountFromNow) {
  EXPECT_EQ(only_value<std::int64_t>("time >= 2026-03-01"), kNow - 36'000'000'000'000);
  EXPECT_EQ(only_value<std::int64_t>("time >= 2026-03-01T10:00"), kNow);
  EXPECT_EQ(only_value<std::int64_t>("time >= 2026-03-01T10:00:30Z"), kNow + 30'000'000'000);
  EXPECT_EQ(only_value<std::int64_t>("time >= -2h"), kNow - 7'200'000'000'000);
  EXPECT_EQ(only_value<std::int64_t>("time >= -90d"), kNow - 90 * 86'400'000'000'000);
  EXPECT_EQ(only_value<std::int64_t>("time < now"), kNow);
}

TEST(Filter, AFaultNamesItsCharacterAndAWayOut) {
  EXPECT_NE(fault_of("residual > 0.1 and solvr = mlem").find("character 20: 'solvr'"), std::string::npos)
      << fault_of("residual > 0.1 and solvr = mlem");
  EXPECT_NE(fault_of("residual > 0.1 and solvr = mlem").find("did you mean 'solver'"), std::string::npos);
  EXPECT_NE(fault_of("state = don").find("did you mean 'done'"), std::string::npos)
      << fault_of("state = don");
  EXPECT_NE(fault_of("residual > small").find("number"), std::string::npos);
  EXPECT_NE(fault_of("time > yesterday").find("no time"), std::string::npos);
  EXPECT_NE(fault_of("time > 2026-02-30").find("no time"), std::string::npos);
  EXPECT_NE(fault_of("solver > mlem").find("is no number"), std::string::npos);
  EXPECT_NE(fault_of("residual ~ 1").find("is no text"), std::string::npos);
  EXPECT_NE(fault_of("capture = 'open").find("no end"), std::string::npos);
  EXPECT_NE(fault_of("(solver = mlem").find("')'"), std::string::npos);
  EXPECT_NE(fault_of("solver = mlem residual > 1").find("character 15"), std::string::npos);
  EXPECT_NE(fault_of("solver in (mlem, )").find("value"), std::string::npos);
  EXPECT_NE(fault_of("solver =").find("the end"), std::string::npos);
  EXPECT_NE(fault_of("capture; DROP").find("';'"), std::string::npos);
  EXPECT_NE(fault_of("residual > 1", FilterOver::Sets).find("field of runs"), std::string::npos);
}

TEST(Filter, DepthLengthAndNumberOfValuesAreBounded) {
  EXPECT_NE(fault_of(std::string(200, '(') + "stale" + std::string(200, ')')), "accepted");
  EXPECT_NE(fault_of(std::string(20'000, ' ')), "accepted");
  std::string many = "index in (0";
  for (int i = 0; i < 600; ++i) many += concat(",", i);
  EXPECT_NE(fault_of(many + ")"), "accepted");
  std::string nots;
  for (int i = 0; i < 500; ++i) nots += "not ";
  EXPECT_NE(fault_of(nots + "stale"), "accepted");
}

TEST(Filter, KnowsWhetherItIsAboutRunsOrAboutWorkThatIsNotDone) {
  EXPECT_FALSE(parse_filter("capture = a and losses = 0", kNow)->mentions_runs);
  EXPECT_TRUE(parse_filter("capture = a and solver = mlem", kNow)->mentions_runs);
  EXPECT_TRUE(parse_filter("state = failed", kNow)->mentions_state);
  EXPECT_FALSE(parse_filter("capture = 'state'", kNow)->mentions_state);
  EXPECT_TRUE(parse_filter("", kNow)->condition.empty());
}

}  // namespace
}  // namespace flamefield
