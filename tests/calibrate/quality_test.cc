#include "calibrate/quality.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquire/simulator/true_rig.h"
#include "proto/board.h"

namespace flamefield {
namespace {

TEST(VolumeError, IsTheShiftWhenOnePrincipalPointIsOff) {
  const Rig truth = ring_with_tolerances({.cameras = 5});
  Rig off = truth;
  off.cameras[2].cx_px += 0.3;
  off.cameras[2].cy_px += 0.4;
  const auto error = volume_error_px(off, truth, {});
  ASSERT_TRUE(error);
  EXPECT_NEAR(error->worst_px, 0.5, 1e-9);
  EXPECT_NEAR(error->mean_px, 0.1, 1e-9);
  EXPECT_EQ(error->worst_camera, "cam02");
}

TEST(VolumeError, AMovedWorldCountsUnlessAligned) {
  const Rig truth = ring_with_tolerances({.cameras = 5});
  Rig moved = truth;
  const Rigid3 world_from_moved = upright_board({1, 2, 3}, 1.7);
  for (Camera& camera : moved.cameras) camera.camera_from_world = camera.camera_from_world * world_from_moved;
  EXPECT_GT(volume_error_px(moved, truth, {})->mean_px, 1);
  EXPECT_LT(volume_error_px(moved, truth, {}, Alignment::Rigid)->worst_px, 1e-6);
}

TEST(VolumeError, NamesAMissingCamera) {
  const Rig truth = ring_with_tolerances({.cameras = 3});
  Rig partial = truth;
  partial.cameras.pop_back();
  const auto error = volume_error_px(partial, truth, {});
  ASSERT_FALSE(error);
  EXPECT_THAT(error.error().message, testing::HasSubstr("cam02"));
}

TEST(Verdict, ChangesColourAtTwoAndFiveTenthsOfAPixel) {
  EXPECT_EQ(verdict_of({0.1, 0.2, "a"}), Verdict::Green);
  EXPECT_EQ(verdict_of({0.1, 0.21, "a"}), Verdict::Amber);
  EXPECT_EQ(verdict_of({0.1, 0.51, "a"}), Verdict::Red);
  EXPECT_EQ(verdict_of({0.1, std::nan(""), "a"}), Verdict::Red);
}

}  // namespace
}  // namespace flamefield
