// Guided calibration sessions the whole way: simulated cameras, someone who turns the board, bus, ledger,
// API.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "calibrate/quality.h"
#include "services/api/pages.h"
#include "services/calibration/output.h"
#include "services/ledger/reader.h"
#include "services/serve/embedded.h"
#include "services/simulation/laboratory.h"
#include "tests/services/burner.h"

namespace flamefield {
namespace {

using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using namespace std::chrono_literals;

class GuidedCalibration : public testing::Test {
 protected:
  void SetUp() override {
    LaboratoryOptions options;
    options.cameras = 5;
    options.board_poses = 12;
    options.board_rate_hz = 8.0 / testing_support::kSlowdown;
    options.first_address = testing_support::own_loopback_address();
    laboratory_ = Laboratory::open(options).value();
    EmbeddedOptions embedded;
    embedded.data_dir = scratch_.path();
    embedded.http_port = -1;
    embedded.workers = 1;
    embedded.acquisition.settings = laboratory_->camera_settings(PixelFormat::Mono8);
    embedded.acquisition.hooks = laboratory_->hooks();
    embedded.acquisition.cameras = laboratory_->cameras();
    embedded.calibration.board = laboratory_->board();
    const Rigid3& reference = laboratory_->world_from_reference_board();
    const Eigen::Vector3d face = -reference.rotation.col(2);
    embedded.calibration.reference_centre_mm = reference.translation_mm;
    embedded.calibration.reference_azimuth_rad = std::atan2(face.z(), face.x());
    embedded.calibration.show_next_pose = [this] { laboratory_->turn_board(); };
    embedded.calibration.picture_patience = 700ms * testing_support::kSlowdown;
    services_ = Embedded::start(bus_, embedded).value();
    client_.emplace(Client::connect(bus_, "operator", unique_name("test"), "inproc://calibration").value());
  }

  CalibrationState state() { return client_->ask_for<CalibrationState>(GetCalibration{}, 60s).value(); }
  // Until `holds`, at most for a minute.
  template <class Holds>
  CalibrationState wait_until(Holds holds) {
    CalibrationState now;
    EXPECT_TRUE(testing_support::eventually([&] { return holds(now = state()); }, 60s)) << json_text(now);
    return now;
  }
  // What a page asks. (status, answer)
  std::pair<int, json> page(const std::string& path, const json& body = nullptr) {
    HttpRequest request;
    request.method = body.is_null() ? "GET" : "POST";
    request.path = "/api/v1/" + path;
    request.body = body.dump();
    const auto answer = answer_api(pages_, path, request);
    if (!answer) return {404, nullptr};
    return {answer->status, json::parse(answer->body)};
  }
  void expect_version(std::int64_t version, std::int64_t poses) {
    auto reader = LedgerReader::open(scratch_.path()).value();
    const auto all = reader.calibrations().value();
    ASSERT_EQ(all.size(), static_cast<std::size_t>(version));
    EXPECT_EQ(all.back().predecessor, version - 1);
    EXPECT_EQ(all.back().accepted_by, "tester");
    EXPECT_EQ(services_->accepted_rig(), all.back().rig_id);
    const auto error = volume_error_px(reader.calibration(version).value().rig, laboratory_->true_rig(), {},
                                       Alignment::Rigid);
    ASSERT_TRUE(error);
    EXPECT_LT(error->worst_px, 0.2);
    // Every pose that was taken is stored, and nothing else.
    const Receipt receipt = reader.receipt(all.back().capture).value();
    EXPECT_TRUE(receipt.balances());
    EXPECT_EQ(receipt.sets, poses);
  }

  const Scratch scratch_;
  std::unique_ptr<Laboratory> laboratory_;
  Bus bus_;
  std::unique_ptr<Embedded> services_;
  std::optional<Client> client_;
  LiveServices pages_{bus_,
                      {.role = "operator",
                       .acquisition = "inproc://acquisition",
                       .dispatcher = "inproc://dispatcher",
                       .data_dir = scratch_.path(),
                       .calibration = "inproc://calibration"}};
};

TEST_F(GuidedCalibration, TakesPosesByItselfSolvesAndBecomesAVersionOfTheLedger) {
  StartCalibration start;
  start.wanted_poses = 8;
  start.automatic = true;
  ASSERT_TRUE(client_->ask_for<CalibrationState>(start, 60s));
  EXPECT_FALSE(client_->ask(StartCalibration{}, 60s)) << "one session at a time";
  EXPECT_FALSE(client_->ask(AcceptCalibration{}, 60s)) << "nothing is solved yet";
  wait_until([](const CalibrationState& s) { return s.poses >= 8; });
  ASSERT_TRUE(client_->ask(SolveCalibration{}, 60s));
  const CalibrationState solved =
      wait_until([](const CalibrationState& s) { return s.phase != CalibrationPhase::Solving; });
  ASSERT_EQ(solved.phase, CalibrationPhase::Solved) << solved.error;
  EXPECT_EQ(solved.verdict, "green");
  EXPECT_EQ(solved.previous_version, 0);
  EXPECT_TRUE(std::filesystem::exists(scratch_.path() / solved.report));
  const auto stored = client_->ask_for<CalibrationStored>(AcceptCalibration{"tester", "first light"}, 60s);
  ASSERT_TRUE(stored) << stored.error().message;
  EXPECT_EQ(stored->version, 1);
  EXPECT_EQ(state().phase, CalibrationPhase::Idle);
  EXPECT_EQ(state().accepted_version, 1);
  expect_version(1, solved.poses);

  // The second one from the page, compared with the first.
  EXPECT_EQ(page("calibration").second["state"], "idle");
  EXPECT_EQ(page("calibration/start", {{"wanted_poses", 1}}).first, 400);
  EXPECT_EQ(page("calibration/start", {{"wanted_poses", "many"}}).first, 400);
  EXPECT_EQ(page("calibration/solve", json::object()).first, 400) << "no session";
  EXPECT_EQ(page("calibration/melt", json::object()).first, 404);
  ASSERT_EQ(page("calibration/start", {{"wanted_poses", 8}, {"automatic", true}}).first, 202);
  EXPECT_EQ(page("calibration/start", json::object()).first, 503);
  EXPECT_EQ(page("calibration/rig").first, 404) << "not solved yet";
  wait_until([](const CalibrationState& s) { return s.poses >= 8; });
  const json detecting = page("calibration").second;
  EXPECT_EQ(detecting["state"], "detecting");
  EXPECT_EQ(detecting["cameras"].size(), 5u);
  EXPECT_EQ(detecting["cameras"][0]["covered"].size(), 9u);
  ASSERT_EQ(page("calibration/solve", json::object()).first, 202);
  const CalibrationState again =
      wait_until([](const CalibrationState& s) { return s.phase != CalibrationPhase::Solving; });
  ASSERT_EQ(again.phase, CalibrationPhase::Solved) << again.error;
  EXPECT_EQ(again.previous_version, 1);
  EXPECT_THAT(again.moved, IsEmpty());
  EXPECT_EQ(page("calibration/rig").second["cameras"].size(), 5u);
  EXPECT_EQ(page("calibration/accept", json::object()).first, 400) << "somebody has to accept it";
  const auto [status, accepted] =
      page("calibration/accept", {{"accepted_by", "tester"}, {"note", "\"second\""}});
  ASSERT_EQ(status, 200) << accepted;
  EXPECT_EQ(accepted["version"], 2);
  expect_version(2, again.poses);
  const json history = page("calibrations").second["calibrations"];
  ASSERT_EQ(history.size(), 2u);
  EXPECT_TRUE(history[0]["worst_shift_px"].is_null());
  EXPECT_LT(history[1]["worst_shift_px"], 0.3);
  EXPECT_EQ(history[1]["note"], "\"second\"");
  EXPECT_EQ(page("rigs/" + history[1]["rig_id"].get<std::string>()).second["cameras"].size(), 5u);
}

TEST_F(GuidedCalibration, TakesAPoseOnRequestAndLeavesNoVersionWhenDiscarded) {
  ASSERT_TRUE(client_->ask(StartCalibration{}, 60s));
  wait_until([](const CalibrationState& s) { return s.still && !s.cameras.empty(); });
  EXPECT_EQ(state().poses, 0) << "only when asked";
  EXPECT_FALSE(client_->ask(AcceptCalibration{"me", ""}, 60s)) << "nothing is solved";
  ASSERT_TRUE(client_->ask(TakePose{}, 60s));
  wait_until([](const CalibrationState& s) { return s.poses == 1; });
  // One pose does not make a ring; the session says why, and goes on.
  ASSERT_TRUE(client_->ask(SolveCalibration{}, 60s));
  const CalibrationState refused =
      wait_until([](const CalibrationState& s) { return s.phase != CalibrationPhase::Solving; });
  EXPECT_EQ(refused.phase, CalibrationPhase::Detecting);
  EXPECT_THAT(refused.error, testing::Not(IsEmpty()));
  ASSERT_TRUE(client_->ask(DiscardCalibration{}, 60s));
  EXPECT_EQ(state().phase, CalibrationPhase::Idle);
  EXPECT_FALSE(client_->ask(TakePose{}, 60s));
  auto reader = LedgerReader::open(scratch_.path()).value();
  EXPECT_THAT(reader.calibrations().value(), IsEmpty());
  const auto captures = reader.captures().value();
  ASSERT_EQ(captures.size(), 1u);
  EXPECT_EQ(captures[0].sets, 1);
  EXPECT_NE(captures[0].capture.finished_time_ns, 0);
  // The cameras are free for others.
  auto array = Client::connect(bus_, "operator", unique_name("test"), "inproc://acquisition").value();
  EXPECT_EQ(array.ask_for<CaptureState>(GetCapture{}, 60s).value().phase, CapturePhase::Idle);
}

TEST_F(GuidedCalibration, SaysThatSomebodyStoppedTheArrayAndEndsAllTheSame) {
  ASSERT_TRUE(client_->ask(StartCalibration{}, 60s));
  wait_until([](const CalibrationState& s) { return !s.cameras.empty() && s.still; });
  auto array = Client::connect(bus_, "operator", unique_name("test"), "inproc://acquisition").value();
  EXPECT_FALSE(array.ask(StartCapture{.kind = CaptureKind::Burst, .pulses = 3}, 60s))
      << "the array is in use";
  ASSERT_TRUE(array.ask_for<CaptureState>(StopCapture{}, 60s));
  const CalibrationState starved = wait_until([](const CalibrationState& s) { return !s.error.empty(); });
  EXPECT_THAT(starved.error, HasSubstr("somebody stopped the array"));
  ASSERT_TRUE(client_->ask(DiscardCalibration{}, 60s));
  EXPECT_EQ(state().phase, CalibrationPhase::Idle);
  EXPECT_THAT(LedgerReader::open(scratch_.path()).value().captures().value(), IsEmpty())
      << "nothing was taken";
}

}  // namespace
}  // namespace flamefield
