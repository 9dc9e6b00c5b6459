#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "calibrate/calibrate.h"
#include "tests/calibrate/synthetic.h"
#include "tests/support/slowdown.h"

// What a ring can be calibrated to, on made-up corners with 0.1 px of noise.
namespace flamefield {
namespace {

constexpr double kSpacing_rad = 12 * std::numbers::pi / 180;

struct Session {
  Rig truth;
  std::vector<Rigid3> poses;
  BoardSpec board;
  CalibrationOptions options;
};

Session session_with(int cameras, int poses, double spacing_rad, std::uint64_t seed) {
  Session out;
  out.truth = ring_with_tolerances({.cameras = cameras, .spacing_rad = spacing_rad, .seed = seed});
  out.poses = board_poses({.count = poses, .last_azimuth_rad = (cameras - 1) * spacing_rad, .seed = seed});
  out.options.world_from_reference = out.poses[0];
  out.options.focal_px = 1212;
  return out;
}

std::vector<Detection> draw(const Session& session, std::uint64_t seed) {
  return synthetic_session(session.truth, session.poses, session.board, 0.1, seed);
}

double rms(const std::vector<double>& values) {
  return std::sqrt(std::inner_product(values.begin(), values.end(), values.begin(), 0.0) /
                   static_cast<double>(values.size()));
}

TEST(Accuracy, EightPosesReachFiveHundredthsOfAPixelAndTwentyThree) {
  for (int poses : {8, 20}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      SCOPED_TRACE(testing::Message() << poses << " poses, seed " << seed);
      const Session session = session_with(15, poses, kSpacing_rad, seed);
      const auto report = calibrate(draw(session, seed), session.board, session.options);
      ASSERT_TRUE(report) << report.error().message;
      const auto error = volume_error_px(report->rig, session.truth, {});
      ASSERT_TRUE(error);
      std::printf("15 x %2d: sigma %.4f px, volume error %.4f px (worst %.4f), expected %.4f, %.2f s\n",
                  poses, report->sigma_px, error->mean_px, error->worst_px,
                  report->expected_volume_error.mean_px, report->seconds);
      EXPECT_NEAR(report->sigma_px, 0.1, 0.003);
      EXPECT_LE(error->mean_px, poses == 8 ? 0.05 : 0.03);
      EXPECT_LE(error->worst_px, poses == 8 ? 0.1 : 0.05);
    }
  }
}

// Errors over 60 draws of the noise against what each draw foresees.
TEST(Accuracy, TheForeseenSigmasAreThoseOfRepeatedSessions) {
  Session session = session_with(8, 12, kSpacing_rad, 3);
  session.options.split_half = false;
  std::vector<double> focal, position, rotation, volume, worst;
  std::vector<double> focal_said, position_said, rotation_said, volume_said;
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    const auto report = calibrate(draw(session, 1000 + seed), session.board, session.options);
    ASSERT_TRUE(report) << report.error().message;
    for (std::size_t c = 0; c < session.truth.cameras.size(); ++c) {
      const Camera &found = report->rig.cameras[c], &truth = session.truth.cameras[c];
      const CameraQuality& said = report->rig.quality->cameras[c];
      focal.push_back(found.fx_px - truth.fx_px);
      position.push_back((found.centre_mm() - truth.centre_mm()).norm());
      rotation.push_back(rotation_angle_rad(found.camera_from_world * truth.camera_from_world.inverse()));
      focal_said.push_back(said.focal_sigma_px);
      position_said.push_back(said.position_sigma_mm);
      rotation_said.push_back(said.rotation_sigma_rad);
      volume_said.push_back(report->camera_volume_px[c]);
      Rig one_found, one_truth;
      one_found.cameras = {found};
      one_truth.cameras = {truth};
      volume.push_back(volume_error_px(one_found, one_truth, {})->mean_px);
    }
  }
  const auto expect_foretold = [](const char* what, const std::vector<double>& said,
                                  const std::vector<double>& happened) {
    const double ratio = rms(said) / rms(happened);
    std::printf("%-9s foreseen %.5f, happened %.5f: %.3f\n", what, rms(said), rms(happened), ratio);
    EXPECT_GT(ratio, 0.9) << what;
    EXPECT_LT(ratio, 1.1) << what;
  };
  expect_foretold("focal", focal_said, focal);
  expect_foretold("position", position_said, position);
  expect_foretold("rotation", rotation_said, rotation);
  expect_foretold("volume", volume_said, volume);
}

TEST(Accuracy, TwentyFourCamerasTimesThirtyPosesTakeLessThanThreeSeconds) {
  const Session session = session_with(24, 30, 7.5 * std::numbers::pi / 180, 4);
  const auto report = calibrate(draw(session, 4), session.board, session.options);
  ASSERT_TRUE(report) << report.error().message;
  const auto error = volume_error_px(report->rig, session.truth, {});
  std::printf(
      "24 x 30: %.2f s with covariance and split half, %d corners, volume error %.4f px (worst %.4f)\n",
      report->seconds, report->corners, error->mean_px, error->worst_px);
  EXPECT_LT(report->seconds, testing_support::kSlowdown * 3);
  EXPECT_LE(error->worst_px, 0.05);
}

TEST(Accuracy, ABentBoardIsFoundOutAndModelled) {
  Session session = session_with(15, 20, kSpacing_rad, 6);
  const Eigen::Vector2d bow_mm(0.3, 0);
  std::vector<Detection> bent;
  {  // corners of the bent board
    const std::vector<Eigen::Vector3d> flat = corners_mm(session.board);
    const double half = flat.back().x();
    std::mt19937_64 engine(6);
    std::normal_distribution<double> noise(0, 0.1);
    bent = draw(session, 6);
    for (std::size_t v = 0; v < bent.size(); ++v) {
      const Camera& camera = session.truth.cameras[v / session.poses.size()];
      const Rigid3& pose = session.poses[v % session.poses.size()];
      for (std::size_t i = 0; i < bent[v].corners_px.size(); ++i) {
        const double u = flat[i].x() / half;
        const Eigen::Vector3d point = flat[i] + Eigen::Vector3d(0, 0, bow_mm.x() * (1 - u * u));
        bent[v].corners_px[i] =
            *project(camera, pose * point) + Eigen::Vector2d(noise(engine), noise(engine));
      }
    }
  }
  const auto as_flat = calibrate(bent, session.board, session.options);
  session.options.free_bow = true;
  const auto as_bent = calibrate(bent, session.board, session.options);
  ASSERT_TRUE(as_flat && as_bent);
  std::printf("0.3 mm bow: RMS %.4f px as if flat, %.4f px modelled, bow %.4f +- %.4f mm, across %.4f mm\n",
              as_flat->rms_px, as_bent->rms_px, as_bent->bow_mm.x(), as_bent->bow_sigma_mm.x(),
              as_bent->bow_mm.y());
  EXPECT_GT(as_flat->rms_px, 0.16);
  EXPECT_NEAR(as_bent->rms_px, 0.1414, 0.003);
  EXPECT_NEAR(as_bent->bow_mm.x(), 0.3, 5 * as_bent->bow_sigma_mm.x());
  EXPECT_NEAR(as_bent->bow_mm.y(), 0, 5 * as_bent->bow_sigma_mm.y());
  EXPECT_LT(as_bent->bow_sigma_mm.x(), 0.01);
}

}  // namespace
}  // namespace flamefield
