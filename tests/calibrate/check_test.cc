#include "calibrate/check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

const Rig kRig = ring_with_tolerances({.cameras = 9, .seed = 21});
const BoardSpec kBoard;

std::vector<Detection> one_pose(const Rig& rig) {
  return synthetic_session(rig, {upright_board({0, 40, 0}, 4 * 0.2094395)}, kBoard, 0.1, 5);
}
// Turns a camera about its own x axis, so that the picture shifts up or down.
Rig bumped(std::size_t camera, double angle_rad) {
  Rig rig = kRig;
  const Rigid3 turn{Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitX()).toRotationMatrix(),
                    Eigen::Vector3d::Zero()};
  rig.cameras[camera].camera_from_world = turn * rig.cameras[camera].camera_from_world;
  return rig;
}

TEST(Check, FindsNothingWhereNothingMoved) {
  const auto report = check(kRig, one_pose(kRig), kBoard);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(report->moved, IsEmpty());
  EXPECT_NEAR(report->rms_px, 0.1414, 0.01);
}

TEST(Check, NamesTheCameraThatWasTurnedByATenthOfADegreeFromOneBoardPose) {
  const auto report = check(kRig, one_pose(bumped(3, 0.1 * std::numbers::pi / 180)), kBoard);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(report->moved, ElementsAre("cam03"));
  EXPECT_NEAR(report->cameras[3].rms_px, 2.1, 0.2);  // 1212 px x 0.1 deg
  EXPECT_NEAR(report->rms_px, 0.1414, 0.01);
}

TEST(Check, NamesTwoCamerasThatMovedFar) {
  Rig rig = bumped(2, 0.05);
  rig.cameras[6] = bumped(6, -0.03).cameras[6];
  const auto report = check(kRig, one_pose(rig), kBoard);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(report->moved, ElementsAre("cam02", "cam06"));
}

TEST(Check, SaysWhichCamerasSawNothing) {
  auto detections = one_pose(kRig);
  detections[7].corners_px.clear();
  const auto report = check(kRig, detections, kBoard);
  ASSERT_TRUE(report) << report.error().message;
  EXPECT_THAT(report->unseen, ElementsAre("cam07"));
}

TEST(Check, RefusesWhatItCannotJudge) {
  auto detections = one_pose(kRig);
  detections.resize(2);
  EXPECT_THAT(check(kRig, detections, kBoard).error().message, HasSubstr("fewer than three"));
  detections = one_pose(kRig);
  detections[1].camera = "stranger";
  EXPECT_THAT(check(kRig, detections, kBoard).error().message, HasSubstr("stranger is not in the rig"));
  detections = one_pose(kRig);
  detections[1].image_height_px = 480;
  EXPECT_THAT(check(kRig, detections, kBoard).error().message, HasSubstr("659x480"));
}

}  // namespace
}  // namespace flamefield
