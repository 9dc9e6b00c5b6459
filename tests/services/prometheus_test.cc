#include "services/api/prometheus.h"

#include <gmock/gmock.h>

#include <regex>
#include <sstream>

namespace flamefield {
namespace {

using ::testing::HasSubstr;

CaptureState some_state() {
  CaptureState state;
  state.phase = CapturePhase::Armed;
  state.sets = 12;
  state.sets_stored = 11;
  state.previews_skipped = 9;
  state.cameras.push_back({"cam00", "127.0.0.2", true, 12, {}, 0.1, {{"count-slip", 1}, {"late", 3}}});
  state.cameras.push_back({"cam01", "127.0.0.3", false, 9, {{"missed", 1}, {"camera-lost", 2}}, -1});
  return state;
}

TEST(Prometheus, NamesEveryLossOfEveryCamera) {
  const std::string text = prometheus_text(some_state(), std::nullopt);
  EXPECT_THAT(text, HasSubstr("flamefield_sets_stored_total 11\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_camera_events_total{camera=\"cam00\",event=\"late\"} 3\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_camera_events_total{camera=\"cam00\",event=\"count-slip\"} 1\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_previews_skipped_total 9\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_camera_connected{camera=\"cam01\"} 0\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_camera_losses_total{camera=\"cam01\",cause=\"camera-lost\"} 2\n"));
}

TEST(Prometheus, EveryLineIsACommentOrASampleOfTheFamilyBeforeIt) {
  Status status;
  status.queued = 3;
  status.counters["leases_expired"] = 1;
  std::istringstream lines(prometheus_text(some_state(), status));
  const std::regex sample("([a-z_]+)(\\{[a-z]+=\"[^\"]*\"(,[a-z]+=\"[^\"]*\")*\\})? -?[0-9.e+-]+");
  std::string family;
  int samples = 0;
  for (std::string line; std::getline(lines, line);) {
    std::smatch match;
    if (line.starts_with("# TYPE ")) {
      family = line.substr(7, line.find(' ', 7) - 7);
    } else if (!line.starts_with("# HELP ")) {
      ASSERT_TRUE(std::regex_match(line, match, sample)) << line;
      EXPECT_EQ(match[1].str(), family);
      ++samples;
    }
  }
  EXPECT_GT(samples, 15);
}

}  // namespace
}  // namespace flamefield
