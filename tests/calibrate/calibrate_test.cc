#include "calibrate/calibrate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

Session session_with(int cameras, int poses, double noise_px, std::uint64_t seed) {
  Session out;
  out.truth = ring_with_tolerances({.cameras = cameras, .seed = seed});
  out.poses = board_poses({.count = poses, .last_azimuth_rad = (cameras - 1) * 0.2094395, .seed = seed});
  out.detections = synthetic_session(out.truth, out.poses, out.board, noise_px, seed);
  out.options.world_from_reference = out.poses[0];
  out.options.focal_px = 1212;
  return out;
}
Result<CalibrationReport> solved(const Session& session) {
  return calibrate(session.detections, session.board, session.options);
}
Detection& view_of(Session& session, const std::string& camera, const std::string& pose) {
  for (Detection& d : session.detections) {
    if (d.camera == camera && d.pose == pose) return d;
  }
  throw std::out_of_range(camera + " " + pose);
}
void hide(Detection& detection) {
  detection.corners_px.clear();
  detection.reason = "board not found";
}

TEST(Calibrate, WithoutNoiseTheTrueRingComesBack) {
  Session session = session_with(5, 10, 0, 1);
  session.options.intrinsics = IntrinsicsMode::Free;
  const auto report = solved(session);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_LT(report->rms_px, 1e-3);
  const auto error = volume_error_px(report->rig, session.truth, {});
  EXPECT_LT(error->worst_px, 2e-3);
}

TEST(Calibrate, TwentyPosesOfFifteenCamerasReachThreeHundredthsOfAPixel) {
  for (std::uint64_t seed : {11, 12}) {
    SCOPED_TRACE(seed);
    const Session session = session_with(15, 20, 0.1, seed);
    const auto report = solved(session);
    ASSERT_TRUE(report) << report.error().message;
    EXPECT_TRUE(report->converged) << report->stop_reason;
    EXPECT_NEAR(report->sigma_px, 0.1, 0.003);
    EXPECT_NEAR(report->rms_px, 0.1414, 0.005);
    const auto error = volume_error_px(report->rig, session.truth, {});
    EXPECT_LT(error->mean_px, 0.03);
    EXPECT_LT(error->worst_px, 0.05) << error->worst_camera;
    EXPECT_EQ(verdict_of(*error), Verdict::Green);
    // The covariance foretells the error; the frame's share is one draw for all cameras.
    EXPECT_LT(error->mean_px, 2 * report->expected_volume_error.mean_px);
    EXPECT_GT(error->mean_px, 0.4 * report->expected_volume_error.mean_px);
    std::printf("15 cameras x 20 poses: rms %.4f px, volume error %.4f px (worst %.4f), %.2f s\n",
                report->rms_px, error->mean_px, error->worst_px, report->seconds);
  }
}

TEST(Calibrate, APointHigherAboveTheBurnerIsHigherInEveryImage) {
  const Session session = session_with(15, 12, 0.1, 3);
  const auto report = solved(session);
  ASSERT_TRUE(report) << report.error().message;
  for (const Camera& camera : report->rig.cameras) {
    EXPECT_LT(project(camera, {0, 60, 0})->y(), project(camera, {0, 20, 0})->y()) << camera.name;
  }
}

TEST(Calibrate, TheWorldMovesWithTheStatedReferencePose) {
  Session session = session_with(4, 8, 0.1, 4);
  const auto before = solved(session);
  const Rigid3 moved_from_world = upright_board({10, -20, 30}, 0.7);
  session.options.world_from_reference = moved_from_world * session.poses[0];
  const auto after = solved(session);
  ASSERT_TRUE(before && after);
  for (std::size_t c = 0; c < before->rig.cameras.size(); ++c) {
    const Eigen::Vector3d expected = moved_from_world * before->rig.cameras[c].centre_mm();
    EXPECT_LT((after->rig.cameras[c].centre_mm() - expected).norm(), 0.05);
  }
}

TEST(Calibrate, GrossCornerErrorsAndOneTurnedViewAreFoundAndLeftOut) {
  Session clean = session_with(8, 16, 0.1, 5), dirty = clean;
  int spoilt = 0, count = 0;
  for (Detection& detection : dirty.detections) {
    for (Eigen::Vector2d& corner : detection.corners_px) {
      if (++count % 50 != 0) continue;
      corner += Eigen::Vector2d(4, -7);
      ++spoilt;
    }
  }
  Detection& turned = view_of(dirty, "cam03", pose_name(5));
  ASSERT_TRUE(turned.found());
  std::reverse(turned.corners_px.begin(), turned.corners_px.end());
  const auto good = solved(clean), report = solved(dirty);
  ASSERT_TRUE(good && report) << report.error().message;
  EXPECT_GE(report->rejected_corners, spoilt);
  const auto clean_error = volume_error_px(good->rig, clean.truth, {});
  const auto error = volume_error_px(report->rig, dirty.truth, {});
  EXPECT_LT(error->mean_px, 1.5 * clean_error->mean_px);
  for (const ViewReport& view : report->views) {
    if (view.camera != "cam03" || view.pose != pose_name(5)) continue;
    EXPECT_FALSE(view.is_used());
    EXPECT_THAT(view.reason, HasSubstr("contradicts"));
  }
}

TEST(Calibrate, FixedIntrinsicsStayAsTheyWere) {
  Session session = session_with(4, 8, 0.1, 6);
  session.options.intrinsics = IntrinsicsMode::Fixed;
  session.options.known = session.truth.cameras;
  const auto report = solved(session);
  ASSERT_TRUE(report) << report.error().message;
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_EQ(report->rig.cameras[c].fx_px, session.truth.cameras[c].fx_px);
    EXPECT_EQ(report->rig.cameras[c].distortion, session.truth.cameras[c].distortion);
    EXPECT_EQ(report->rig.quality->cameras[c].focal_sigma_px, 0);
  }
  session.options.known.pop_back();
  const auto refused = solved(session);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("cam03 has no known intrinsics"));
}

TEST(Calibrate, ALooseCameraIsNamed) {
  Session session = session_with(4, 8, 0.1, 7);
  for (Detection& detection : session.detections) {
    if (detection.camera == "cam02") hide(detection);
  }
  const auto refused = solved(session);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("cam02"));
  session.options.require_connected = false;
  const auto report = solved(session);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_FALSE(report->connected);
  EXPECT_THAT(report->unconnected, ElementsAre("cam02"));
  EXPECT_EQ(report->rig.cameras.size(), 3u);
  EXPECT_TRUE(validate(report->rig));
}

TEST(Calibrate, ARingInTwoPartsNamesThePartWithoutTheReference) {
  Session session = session_with(4, 8, 0.1, 8);
  for (Detection& detection : session.detections) {
    const bool first_half = detection.camera < "cam02", even = (detection.pose.back() - '0') % 2 == 0;
    if (first_half != even) hide(detection);
  }
  const auto refused = solved(session);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().message, HasSubstr("cam02, cam03"));
}

TEST(Calibrate, TheReportAccountsForEveryViewAndCorner) {
  Session session = session_with(4, 8, 0.1, 9);
  hide(view_of(session, "cam01", pose_name(3)));
  const auto report = solved(session);
  ASSERT_TRUE(report) << report.error().message;
  ASSERT_EQ(report->views.size(), session.detections.size());
  int corners = 0, detected = 0;
  for (const ViewReport& view : report->views) {
    EXPECT_EQ(view.is_used(), view.reason.empty());
    detected += static_cast<int>(view.corners_px.size());
    if (view.is_used()) corners += static_cast<int>(view.residuals_px.size()) - view.rejected;
  }
  EXPECT_EQ(corners, report->corners);
  EXPECT_EQ(detected, report->corners + report->rejected_corners);
  EXPECT_EQ(report->pairs.size(), 6u);
  ASSERT_TRUE(report->rig.quality);
  EXPECT_EQ(report->rig.quality->cameras[1].images + 1, report->rig.quality->cameras[0].images);
}

TEST(Calibrate, SaysWhatIsWrongWithTheInput) {
  const auto message = [](const Session& session) {
    const auto report = solved(session);
    return report ? std::string("no error") : report.error().message;
  };
  const Session good = session_with(3, 6, 0.1, 10);

  Session none = good;
  for (Detection& detection : none.detections) hide(detection);
  EXPECT_THAT(message(none), HasSubstr("no board in any of 18 images"));

  Session single = good;
  for (Detection& detection : single.detections) {
    if (detection.pose != pose_name(0)) hide(detection);
  }
  EXPECT_THAT(message(single), HasSubstr("only one board pose"));

  Session sizes = good;
  sizes.detections[1].image_width_px = 640;
  EXPECT_THAT(message(sizes), HasSubstr("640x494"));

  Session twice = good;
  twice.detections[1].pose = twice.detections[0].pose;
  EXPECT_THAT(message(twice), HasSubstr("two images of pose"));

  Session reference = good;
  reference.options.reference_pose = "burner";
  EXPECT_THAT(message(reference), HasSubstr("reference pose 'burner'"));

  Session other_board = good;
  other_board.board.cols = 7;
  EXPECT_THAT(message(other_board), HasSubstr("54 corners"));

  Session nan = good;
  nan.detections[0].corners_px.assign(nan.board.corners(), Eigen::Vector2d(1, std::nan("")));
  EXPECT_THAT(message(nan), HasSubstr("not a number"));
}

}  // namespace
}  // namespace flamefield
