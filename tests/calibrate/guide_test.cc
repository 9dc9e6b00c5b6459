#include "calibrate/guide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

std::vector<std::string> names_of(const Rig& rig) {
  std::vector<std::string> names;
  for (const Camera& camera : rig.cameras) names.push_back(camera.name);
  return names;
}

struct Shown {
  Rig rig = ring_with_tolerances({.cameras = 6, .seed = 4});
  BoardSpec board;
  std::vector<Detection> of(const std::vector<Rigid3>& poses) const {
    return synthetic_session(rig, poses, board, 0.05, 1);
  }
  // Facing camera number k.
  static Rigid3 towards(double k) { return upright_board({0, 40, 0}, k * 0.20944); }
};

TEST(Guide, AsksForTheReferenceFirst) {
  const Shown shown;
  const Guidance guidance = guide({}, {.cameras = names_of(shown.rig)});
  EXPECT_THAT(guidance.needed, ElementsAre(HasSubstr("holder on the burner")));
}

TEST(Guide, NamesTheNeighboursThatHaveToSeeOnePoseTogether) {
  const Shown shown;
  std::vector<Detection> taken = shown.of({Shown::towards(1), Shown::towards(4)});
  // Half of the ring saw the first pose, the other half the second.
  for (Detection& view : taken) {
    const bool is_low = view.camera < "cam03";
    if (is_low != (view.pose == "pose00")) view.corners_px.clear();
  }
  const Guidance guidance = guide(taken, {.cameras = names_of(shown.rig)});
  ASSERT_EQ(guidance.links_missing.size(), 1u);
  EXPECT_EQ(guidance.links_missing[0].connected, "cam02");
  EXPECT_EQ(guidance.links_missing[0].loose, "cam03");
  EXPECT_EQ(guidance.needed.front(), "show the board to cam02 and cam03 at once");
}

TEST(Guide, SendsTheBoardToTheCameraThatSawItLeast) {
  const Shown shown;
  std::vector<Detection> taken = shown.of({Shown::towards(2), Shown::towards(2.3), Shown::towards(2.6)});
  for (Detection& view : taken)
    if (view.camera == "cam05" && view.pose != "pose00") view.corners_px.clear();
  const Guidance guidance =
      guide(taken, {.cameras = names_of(shown.rig), .wanted_poses = 3, .wanted_boards = 3});
  EXPECT_THAT(guidance.links_missing, IsEmpty());
  EXPECT_EQ(guidance.needed.front(), "tilt the board towards cam05 (1 of 3 pictures)");
  EXPECT_THAT(guidance.needed, Not(Contains(HasSubstr("cam02 ("))));
}

TEST(Guide, NamesTheFieldsOfAPictureThatHaveNoCorners) {
  const Shown shown;
  // Always low and to the left of the picture of the camera that faces it.
  std::vector<Rigid3> poses;
  for (int k = 0; k < 6; ++k) poses.push_back(upright_board({0, 5, 40}, 0.02 * k));
  const Guidance guidance = guide(shown.of(poses), {.cameras = {"cam00"}, .wanted_poses = 6});
  ASSERT_FALSE(guidance.needed.empty());
  EXPECT_THAT(guidance.needed.front(), HasSubstr("cover the upper left and the upper middle of cam00"));
  EXPECT_LT(guidance.cameras[0].coverage, 0.7);
}

TEST(Guide, ASolvedSessionWithEnoughPosesNeedsNothing) {
  const Shown shown;
  const auto poses = board_poses({.count = 24, .last_azimuth_rad = 5 * 0.20944, .seed = 4});
  const auto taken = shown.of(poses);
  const auto report = calibrate(taken, shown.board, {.world_from_reference = poses[0], .split_half = false});
  ASSERT_TRUE(report) << report.error().message;
  const Guidance guidance = guide(taken, {.cameras = names_of(shown.rig), .wanted_volume = 0.3}, &*report);
  EXPECT_THAT(guidance.needed, IsEmpty());
  std::printf("volume coverage of 24 poses: %.2f\n", report->coverage.volume);
  // A demand that cannot be met is stated with the camera that meets it least.
  const Guidance strict = guide(taken, {.cameras = names_of(shown.rig), .wanted_error_px = 1e-4}, &*report);
  EXPECT_THAT(strict.needed.front(), HasSubstr("it is uncertain by"));
}

TEST(Guide, APoseIsNewWhereSomeCameraSeesTheBoardElsewhere) {
  const Shown shown;
  const auto taken = shown.of({Shown::towards(2)});
  EXPECT_FALSE(is_new_pose(taken, taken, 4));
  EXPECT_TRUE(is_new_pose(taken, {}, 4));
  EXPECT_TRUE(is_new_pose(shown.of({Shown::towards(3)}), taken, 4));
  std::vector<Detection> nothing = taken;
  for (Detection& view : nothing) view.corners_px.clear();
  EXPECT_FALSE(is_new_pose(nothing, taken, 4));
}

}  // namespace
}  // namespace flamefield
