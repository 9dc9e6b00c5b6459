#include "calibrate/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

Rigid3 small_turn(double angle_rad) {
  return {Eigen::AngleAxisd(angle_rad, Eigen::Vector3d(1, 2, -1).normalized()).toRotationMatrix(),
          Eigen::Vector3d::Zero()};
}

// The same ring in another world frame.
Rig moved_world(Rig rig, const Rigid3& old_from_new) {
  for (Camera& camera : rig.cameras) camera.camera_from_world = camera.camera_from_world * old_from_new;
  return rig;
}

TEST(CompareRigs, FindsNothingButTheShiftOfTheWorld) {
  const Rig before = ring_with_tolerances({.seed = 3});
  Rigid3 shift = small_turn(0.01);
  shift.translation_mm = {2, -1, 0.5};
  const auto found = compare_rigs(moved_world(before, shift), before, {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_THAT(found->moved, IsEmpty());
  for (const CameraShift& camera : found->cameras) EXPECT_LT(camera.shift_px, 1e-3) << camera.camera;
  EXPECT_NEAR(found->world_turn_rad, 0.01, 1e-6);
  EXPECT_GT(found->world_shift_mm, 1);
}

TEST(CompareRigs, NamesTheCamerasThatMovedAndByHowMuch) {
  const Rig before = ring_with_tolerances({.seed = 3});
  Rig now = moved_world(before, small_turn(0.005));
  // A principal point that is off shifts every pixel by as much.
  now.cameras[4].cx_px += 1.5;
  now.cameras[11].cy_px -= 0.8;
  const auto found = compare_rigs(now, before, {});
  ASSERT_TRUE(found) << found.error().message;
  EXPECT_THAT(found->moved, ElementsAre("cam04", "cam11"));
  EXPECT_NEAR(found->cameras[4].shift_px, 1.5, 1e-3);
  EXPECT_NEAR(found->cameras[11].shift_px, 0.8, 1e-3);
  EXPECT_LT(found->cameras[0].shift_px, 1e-3);
}

TEST(CompareRigs, TheNoiseOfTwoSessionsMovesNobody) {
  const Rig truth = ring_with_tolerances({.cameras = 8, .seed = 5});
  const BoardSpec board;
  Rig rigs[2];
  for (std::size_t i = 0; i < 2; ++i) {
    const auto poses = board_poses({.count = 14, .last_azimuth_rad = 7 * 0.20944, .seed = 7 + i});
    const auto report = calibrate(synthetic_session(truth, poses, board, 0.1, 20 + i), board,
                                  {.world_from_reference = poses[0], .split_half = false});
    ASSERT_TRUE(report) << report.error().message;
    rigs[i] = report->rig;
  }
  const auto found = compare_rigs(rigs[1], rigs[0], {});
  ASSERT_TRUE(found);
  EXPECT_THAT(found->moved, IsEmpty());
}

TEST(CompareRigs, SaysWhichCamerasAreNewOrGone) {
  const Rig before = ring_with_tolerances({.cameras = 6, .seed = 3});
  Rig now = before;
  now.cameras.erase(now.cameras.begin());
  now.cameras.back().name = "cam99";
  const auto found = compare_rigs(now, before, {});
  ASSERT_TRUE(found);
  EXPECT_THAT(found->added, ElementsAre("cam99"));
  EXPECT_THAT(found->missing, ElementsAre("cam00", "cam05"));
  now.cameras.resize(2);
  EXPECT_FALSE(compare_rigs(now, before, {}));
}

}  // namespace
}  // namespace flamefield
