#include "services/api/prometheus.h"

#include <gmock/gmock.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
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

LedgerFigures some_figures() {
  LedgerFigures figures;
  figures.jobs = {{{Priority::Live, JobState::Queued}, 3}};
  figures.oldest_waiting_s = 1.5;
  figures.pulse_to_volume_s = figures.set_to_stored_s = {0.1, 0.2, 0.3, 0.4};
  figures.stage_s = {{"solve", {0.1}}};
  figures.schedule_outcomes = {{"submitted", 2}};
  return figures;
}

std::string everything() {
  Status status;
  status.program_version = "1.2.3";
  status.queued = 3;
  status.counters["leases_expired"] = 1;
  return prometheus_text(some_state(), status) + prometheus_text(some_figures(), machine_figures("."));
}

TEST(Prometheus, QuantilesAreMeasuredValues) {
  const std::string text = everything();
  EXPECT_THAT(text, HasSubstr("flamefield_pulse_to_volume_seconds{quantile=\"0.5\"} 0.2\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_pulse_to_volume_seconds{quantile=\"0.99\"} 0.4\n"));
  EXPECT_THAT(text, HasSubstr("flamefield_queue_jobs{priority=\"live\",state=\"queued\"} 3\n"));
}

TEST(Prometheus, AFamilyComesOnce) {
  std::istringstream lines(everything());
  std::set<std::string> families;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("# TYPE ")) {
      EXPECT_TRUE(families.insert(line).second) << line;
    }
  }
}

// The dashboard and the alerts that are shipped ask for nothing that is not there.
TEST(Prometheus, EveryMetricOfDashboardAndAlertsExists) {
  const std::filesystem::path deploy = std::filesystem::path(FLAMEFIELD_TEST_DATA) / ".." / ".." / "deploy";
  const std::string text = everything();
  const std::regex name("flamefield_[a-z_]+");
  int found = 0;
  for (const char* file : {"grafana/flamefield.json", "prometheus/alerts.yml"}) {
    std::ifstream in(deploy / file);
    const std::string content((std::istreambuf_iterator<char>(in)), {});
    ASSERT_FALSE(content.empty()) << file;
    for (std::sregex_iterator match(content.begin(), content.end(), name), end; match != end;
         ++match, ++found)
      EXPECT_THAT(text, HasSubstr("# TYPE " + match->str() + " ")) << file;
  }
  EXPECT_GT(found, 30);
  std::ifstream dashboard(deploy / "grafana/flamefield.json");
  const auto json = nlohmann::json::parse(dashboard, nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  EXPECT_GE(json["panels"].size(), 10u);
  for (const auto& panel : json["panels"]) {
    if (panel["type"] == "row") continue;
    EXPECT_FALSE(panel["title"].get<std::string>().empty());
    EXPECT_FALSE(panel["targets"].empty()) << panel["title"];
    EXPECT_FALSE(panel["fieldConfig"]["defaults"]["unit"].get<std::string>().empty()) << panel["title"];
  }
}

TEST(Prometheus, EveryLineIsACommentOrASampleOfTheFamilyBeforeIt) {
  std::istringstream lines(everything());
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
