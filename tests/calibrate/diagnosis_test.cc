#include "calibrate/diagnosis.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "acquire/simulator/board_scene.h"
#include "calibrate/detect.h"
#include "tests/calibrate/synthetic.h"

namespace flamefield {
namespace {

using testing::HasSubstr;

const Camera kCamera = ring_with_tolerances({.cameras = 1}).cameras[0];

// 8 bits of a board; `exposure` 1 is a good one.
Image picture(const Rigid3& pose, double defocus_sigma_px = 0.7, double exposure = 1,
              const BoardSpec& board = {}) {
  BoardScene scene;
  scene.board = board;
  scene.defocus_sigma_px = defocus_sigma_px;
  Image image = render_board(kCamera, pose, scene);
  for (float& value : image.pixels) value *= static_cast<float>(exposure);
  return with_noise(std::move(image), scene.full_scale_electrons, 5);
}
Rigid3 facing(double obliquity_deg, const Eigen::Vector3d& centre_mm = {0, 40, 0}) {
  return upright_board(centre_mm, obliquity_deg * std::numbers::pi / 180);
}
std::string reason(const Image& image, const BoardSpec& board = {}) {
  const Detection detection = detect_board({"cam00", "pose", image}, board);
  return detection.found() ? "found" : detection.reason;
}

TEST(Diagnosis, ABoardThatIsTurnedTooFarIsTooOblique) {
  for (double angle : {74.0, 78.0, -76.0}) {
    EXPECT_THAT(reason(picture(facing(angle))), HasSubstr("too oblique")) << angle;
  }
}

TEST(Diagnosis, ABoardOutOfFocusIsBlurred) {
  for (double sigma : {6.0, 8.0})
    EXPECT_THAT(reason(picture(facing(10), sigma)), HasSubstr("blurred")) << sigma;
}

TEST(Diagnosis, ABoardThatLeavesTheImageIsCutOffAtThatEdge) {
  EXPECT_THAT(reason(picture(facing(0, {0, 40, 130}))), HasSubstr("cut off at the left edge"));
  EXPECT_THAT(reason(picture(facing(0, {0, 40, -130}))), HasSubstr("cut off at the right edge"));
  EXPECT_THAT(reason(picture(facing(0, {0, 150, 0}))), HasSubstr("cut off at the upper edge"));
}

TEST(Diagnosis, AnUnderexposedBoardIsTooDark) {
  EXPECT_THAT(reason(picture(facing(10), 0.7, 0.002)), HasSubstr("too dark"));
}

TEST(Diagnosis, ASaturatedBoardIsOverexposed) {
  EXPECT_THAT(reason(picture(facing(10), 0.7, 40)), HasSubstr("overexposed"));
}

TEST(Diagnosis, SaysWhichBoardItSaw) {
  const Image image = picture(facing(10), 0.7, 1, {9, 6, 12});
  EXPECT_THAT(reason(image, {11, 8, 12}), HasSubstr("looked for 11x8 inner corners, found 9x6"));
  EXPECT_THAT(reason(image, {8, 7, 12}), HasSubstr("another board: looked for 8x7 inner corners, found 9x6"));
}

// Which part of the larger board would be seen, nobody could tell.
TEST(Diagnosis, ABoardInsideALargerOneIsRefusedAndTheLargerOneNamed) {
  for (double angle : {0.0, 25.0, -50.0}) {
    const Image image = picture(facing(angle), 0.7, 1, {9, 6, 12});
    EXPECT_EQ(reason(image, {9, 6, 12}), "found") << angle;
    for (const BoardSpec& asked :
         {BoardSpec{8, 6, 12}, BoardSpec{9, 5, 12}, BoardSpec{7, 4, 12}, BoardSpec{5, 8, 12}})
      EXPECT_THAT(reason(image, asked), HasSubstr("inner corners, found 9x6")) << angle << ' ' << asked.cols;
  }
}

TEST(Diagnosis, AnEmptyRoomIsNoBoard) {
  EXPECT_THAT(reason(picture(facing(180))), HasSubstr("no board"));
}

}  // namespace
}  // namespace flamefield
